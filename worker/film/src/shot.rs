//! What a picture of one person needs beside the person.

use yoto_capture::camera::{Camera, Pose};

/// One picture of one person.
#[derive(Debug)]
pub(crate) struct Shot {
    pub(crate) pose: Pose,
    pub(crate) camera: Camera,
}
