//! The `mechid` program.

fn main() {}
