//! Free decays that are known exactly, alone and under noise.

mod exact;
mod noisy;
