//! Body landmarks and masks of pictures, by a pose model that runs in this process.
//!
//! The model is BlazePose (Apache-2.0): two networks in TensorFlow Lite files, which `deploy/models/get.sh`
//! fetches. Both run on the CPU, without other libraries.
//!
//! ```text
//! picture → detector → region (a rotated square around the body)
//!                        ↓
//!           landmark model → landmarks in the picture and in space, mask, score
//!                        ↓
//!           the next picture's region
//! ```

pub mod colours;
mod detector;
mod error;
mod face;
mod hand;
mod landmarks;
mod mask;
mod model;
mod network;
mod people;
mod region;
mod tflite;
mod watcher;

pub use error::LandmarkError;
pub use face::{FACE_POINTS, FaceLandmarks, FaceModel};
pub use hand::{HAND_POINTS, HandLandmarks, HandModel};
pub use mask::{Outline, PERSON, clean, parts};
pub use model::PoseModel;
pub use people::{BodySquare, PersonTrack, Sighting, Target, people};
pub use watcher::{PersonLandmarks, Watcher};
