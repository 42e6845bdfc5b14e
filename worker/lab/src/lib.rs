//! Experiments: models trained and measured in one process, without a service.
//!
//! - [`quality`]: quality of a model on held-out pictures of given captures.
//! - [`captures`], [`one_camera`]: films and their held-out pictures.
//! - [`ablation`]: the paper's four variants on the same captures.
//! - [`displacement`]: how near learned motion of clothes comes to the truth.
//! - [`tradeoff`]: what training time and render time buy, with [`plot`]s.
//! - [`model_dir`]: figures of a trained model in a folder.
//! - [`bench`]: seconds of a training step, stage by stage.
//! - [`people`]: many people in one model, and people who join one.
//! - [`report`], [`split_regions`]: the form of results on disk and in a terminal.
//! - [`pictures`]: 8-bit pictures on disk.
//!
//! Nothing here prints: the caller passes a [`display::Screen`].

pub mod ablation;
mod alignment;
pub mod bench;
pub mod captures;
mod cast;
pub mod displacement;
pub mod display;
mod limits;
mod measure;
mod memory;
pub mod model_dir;
pub mod one_camera;
mod other_poses;
pub mod people;
pub mod pictures;
pub mod plot;
pub mod pose_error;
pub mod quality;
pub mod report;
pub mod split_regions;
pub mod tradeoff;
mod training;
