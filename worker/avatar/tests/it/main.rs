//! The model as a library: training, pictures, and numbers that a reference computed.

mod curve;
mod distill;
mod exposure;
mod extremes;
mod fingers;
mod finite_diff;
mod floor;
#[cfg(feature = "gpu")]
mod gpu;
mod harmonics;
mod humannerf;
mod joining;
mod leaving;
mod levels;
mod lpips;
mod mlp;
mod parity;
mod picture_loss;
mod plain;
mod refinement;
mod sharing;
mod speed;
mod splat_scenes;
mod splats;
mod support;
mod surface;
mod together;
mod tradeoff;
mod training;
mod unseen;
