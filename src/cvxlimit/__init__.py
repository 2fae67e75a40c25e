"""cvxlimit: certified collapse loads of dry-jointed masonry."""
