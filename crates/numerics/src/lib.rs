//! Numerical methods that several crates share; nothing here knows of machines or records.
