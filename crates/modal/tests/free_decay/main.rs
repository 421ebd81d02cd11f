//! Free decays that are known exactly, without noise and with noise.

mod exact;
mod noisy;
