//! What every scheme must do: the suite that defines the word.

mod charts;
mod common;
mod order;
mod periodic;
