"""The records that the folders of Evenlight hand to each other as files."""

if (
    __name__ != "evenlight.data_schema"
):  # `import data_schema` in a checkout would make a second copy of every module
    raise ImportError("import it as evenlight.data_schema")
