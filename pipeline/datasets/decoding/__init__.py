"""Files of pictures and videos to grey levels, and what their headers say of orientation, depth and codec."""
