"""No more model than a scene needs: transformations of the static problem, and their inverses."""
