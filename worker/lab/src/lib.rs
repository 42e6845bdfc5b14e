//! Experiments: models trained and measured in one process, without a service.
//!
//! - [`quality`]: quality of a model on held-out pictures of given captures.
//! - [`captures`], [`one_camera`]: films and their held-out pictures.
//! - [`real`]: clips as people have them, through the whole path.
//! - [`ablation`]: the paper's four variants on the same captures.
//! - [`stress`]: people in poses that no film shows, beside their truth.
//! - [`poses`]: poses that are found in films of people whose poses are known.
//! - [`lift`]: the network that finds the depth of key points.
//! - [`displacement`]: the error of learned motion of clothes.
//! - [`tradeoff`]: quality over training time and over render time.
//! - [`model_dir`]: figures of a trained model in a folder.
//! - [`mod@bench`]: seconds of a training step, stage by stage.
//! - [`report`], [`split_regions`]: the form of results on disk and in a terminal.
//! - [`commands`]: the `yoto-lab` command line.
//!
//! Only [`commands`] prints; experiments show their progress on a [`display::Screen`].

#[macro_use(say, tell)]
extern crate yoto_terminal;

pub mod ablation;
mod actor;
mod alignment;
pub mod bench;
pub mod captures;
mod cast;
pub mod commands;
pub mod displacement;
pub mod display;
pub mod lift;
mod limits;
mod measure;
mod memory;
pub mod model_dir;
mod npz;
pub mod one_camera;
mod other_poses;
pub mod pose_error;
pub mod poses;
pub mod quality;
pub mod real;
pub mod report;
pub mod split_regions;
pub mod stress;
pub mod tradeoff;
mod training;
