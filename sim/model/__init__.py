"""Arrays that kernels read and write: Model, Data; options, slots of optional kernels."""
