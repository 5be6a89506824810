"""The paper's section 3: from pixel values to contrast loss, and from contrast loss to a brightness track."""
