//! PeopleSnapshot, one folder per subject.
//!
//! - `camera.pkl` (of Python 2): `camera_f`, `camera_c` `[2]` px, `camera_k` `[5]` (OpenCV's
//!   distortion), `camera_rt` `[3]` (axis-angle), `camera_t` `[3]`, `width`, `height`; world to
//!   camera, metres, pixel coordinates from the first pixel's centre.
//! - `reconstructed_poses.hdf5`: `pose` `[F, 72]`, `trans` `[F, 3]`, `betas` `[10]`.
//! - `masks.hdf5`: `masks` `[F, H, W]`, non-zero where the person is.
//! - `<subject>.mp4`, or its frames as `images/*.png`.
//!
//! A client without the feature `hdf5` has no reader of HDF5, and says so.

#[cfg(feature = "hdf5")]
mod capture;

use crate::source::Source;
use crate::{ImportError, Imported, Options};

const CAMERA: &str = "camera.pkl";
const POSES: &str = "reconstructed_poses.hdf5";
const MASKS: &str = "masks.hdf5";

/// The files of a folder that is recognised.
pub(crate) const MARKS: &[&str] = &[POSES, CAMERA];

#[cfg(feature = "hdf5")]
pub(crate) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    capture::read(source, options)
}

#[cfg(not(feature = "hdf5"))]
pub(crate) fn read(source: &Source, _options: &Options) -> Result<Imported, ImportError> {
    let message = format!(
        "PeopleSnapshot's {POSES} and {MASKS} need a reader of HDF5, which this client was built \
         without: {}",
        crate::features::how_to_get("hdf5")
    );
    Err(source.fault("UNSUPPORTED", POSES, None, "", message))
}
