"""The paper's section 3: from pixel values to contrast loss, and from contrast loss to a brightness track."""

if __name__ != "evenlight.method":  # a second copy of every module would come with the other name
    raise ImportError("import it as evenlight.method")
