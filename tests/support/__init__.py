"""What tests of many files share: commands, a kind of map without kernels, reading files in this process."""
