"""The shape of the package, its documents and examples, and whether the tests catch faults."""
