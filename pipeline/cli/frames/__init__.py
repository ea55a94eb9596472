"""Reading what users point at: pictures, videos and folders, frame by frame, and what cannot be used of them."""
