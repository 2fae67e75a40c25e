"""x"""
def write_page(docs, found): pass
