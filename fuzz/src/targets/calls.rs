//! The public functions of the crates, called with arguments drawn from bytes.

use super::{analysis, estimate, force, integrate, model, signal};
use crate::{Input, Target};

const fn target(name: &'static str, run: fn(&[u8]) -> Result<(), String>) -> Target {
    Target { name, corpus: "calls", input: Input::Bytes, memory: [64 << 20, 0], run }
}

pub const TARGETS: [Target; 6] = [
    target("signal", signal::calls),
    target("model", model::calls),
    target("integrate", integrate::calls),
    target("estimate", estimate::calls),
    target("force", force::calls),
    target("analysis", analysis::calls),
];
