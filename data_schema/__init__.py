"""The records that the folders of Evenlight hand to each other as files."""
