"""Videos as frames: files and folders of images, their colours and times, reading ahead, writing."""
