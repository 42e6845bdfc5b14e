//! From a camera to pixels: rays through the body's box, samples along them, fields at the
//! samples that can contribute, and compositing (paper eq. 9).

mod between;
mod blend;
mod carried;
pub mod composite;
mod enlarge;
mod exposure;
mod fields;
mod followed;
pub(crate) mod frame;
mod levels;
pub mod march;
pub mod occupancy;
mod released;
mod rest_points;
pub mod samples;
mod settings;
mod skinned_splats;
pub(crate) mod splats;
mod together;
mod view;
pub mod walk;

pub use exposure::FrameExposure;
pub use followed::FollowedSplats;
pub use frame::{RenderError, Rendered, Renderer};
pub use rest_points::RestPoints;
pub use samples::SampleCounts;
pub use settings::RenderSettings;
pub use skinned_splats::{SkinnedShapes, SkinnedSplat, SkinnedSplats};
pub use together::{Guest, render_together};
pub use view::{Actor, Light, RenderView, SceneView};
