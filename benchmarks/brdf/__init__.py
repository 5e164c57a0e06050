"""BRDFs: lobes against data in MERL's format, what the classical lobe breaks, and what radiosity leaves out."""
