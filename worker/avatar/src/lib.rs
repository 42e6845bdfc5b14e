//! The YOTO avatar model as a library: no network, no async, no database.
//!
//! Data flows one way: shards and frames of `yoto_capture` → rays through the body's box → [`avatar`], made
//! of [`motion`] (prior, weights, correction), [`identity`] (codes, pose condition) and [`field`]
//! (non-rigid, canonical or splats) → [`render`] (march, composite) → [`loss`], [`evaluate`] → [`train`]
//! (step, guard, trainer, checkpoint), [`tradeoff`].
//! `fit` brings poses into agreement with pictures, `yoto_ops` holds the tensor operations that Burn
//! lacks, [`import`] reads HumanNeRF's checkpoints, and [`config`] describes a model as data.

pub mod avatar;
pub mod config;
pub mod decoder;
pub mod distill;
pub mod evaluate;
pub mod field;
mod fit;
pub mod host;
mod identity;
pub mod import;
mod init;
pub mod loss;
pub mod motion;
mod pool;
pub mod render;
pub mod tradeoff;
pub mod train;
