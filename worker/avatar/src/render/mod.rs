//! From a camera to pixels: rays through the body's box, samples along them, fields at the
//! samples that can contribute, and compositing (paper eq. 9).

mod blend;
pub mod composite;
mod enlarge;
mod exposure;
mod fields;
pub(crate) mod frame;
mod levels;
pub mod march;
mod morph;
pub mod occupancy;
mod released;
mod rest_points;
mod rest_splats;
pub mod samples;
mod settings;
mod skinned_splats;
pub(crate) mod splats;
mod together;
mod tracked_splats;
mod view;
pub mod walk;

pub use exposure::FrameExposure;
pub use frame::{RenderError, Rendered, Renderer};
pub use rest_points::RestPoints;
pub use samples::SampleCounts;
pub use settings::RenderSettings;
pub use skinned_splats::{SkinnedShapes, SkinnedSplat, SkinnedSplats};
pub use together::{ModelActor, render_together};
pub use tracked_splats::TrackedSplats;
pub use view::{Actor, Light, RenderView, SceneView};
