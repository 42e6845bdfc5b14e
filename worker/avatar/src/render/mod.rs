//! From a camera to pixels: rays through the body's box, samples along them, fields at the
//! samples that can contribute, and compositing (paper eq. 9).

mod blend;
pub mod composite;
mod enlarge;
pub(crate) mod frame;
pub mod march;
pub mod occupancy;
mod released;
mod rest_points;
mod settings;

pub use frame::{RenderError, RenderView, Rendered, Renderer};
pub use march::SampleCounts;
pub use rest_points::RestPoints;
pub use settings::RenderSettings;
