def furnish(key, road, pavement_m, site):
    return []
def scatter(key, site):
    return []
