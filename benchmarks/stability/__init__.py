"""Where methods fail: scenes made to break them, and what each method says about them."""
