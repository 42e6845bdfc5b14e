//! Masks that a matting model makes of the frames of a clip.
//!
//! `yoto_matting` knows the inputs and outputs of a network. Here the levels of its pictures are found
//! (`levels`), and it gets the frames in order (`run`). A client without the feature `matting` has
//! no runtime for networks, and says so.

#[cfg(feature = "matting")]
mod levels;
#[cfg(feature = "matting")]
mod run;

use crate::clip::{Clip, fault};
use crate::pictures::Mask;
use crate::{ImportError, MattingModel, Progress};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A frame to make a mask of.
#[cfg_attr(
    not(feature = "matting"),
    expect(dead_code, reason = "no network is given them")
)]
pub(super) struct MaskRequest {
    /// Its number.
    pub frame: usize,
    /// A rough mask of the person, of the clip's size, 0 to 255.
    pub expected: Option<Vec<u8>>,
}

impl MattingModel {
    /// The person's masks in the frames `wanted`, in ascending order. Frames that show nobody have none.
    ///
    /// # Errors
    /// When the file is not a matting model, its levels can't be found, the network fails, or this build has no runtime for
    /// networks.
    pub(super) fn masks(
        &self,
        clip: &Clip,
        wanted: &[MaskRequest],
        progress: &Progress,
        notes: &mut Vec<String>,
    ) -> Result<BTreeMap<usize, Mask>, ImportError> {
        #[cfg(feature = "matting")]
        {
            run::masks(self, clip, wanted, progress, notes)
        }
        #[cfg(not(feature = "matting"))]
        {
            let _ = (clip, wanted, progress, notes);
            Err(crate::features::no_matting(self))
        }
    }
}

/// Coverage of a frame as a grey PNG.
pub(super) fn png(coverage: &[u8], clip: &Clip) -> Result<Arc<[u8]>, ImportError> {
    let mut png = Vec::new();
    let [width, height] = clip.size;
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Up)
        .write_image(coverage, width, height, ExtendedColorType::L8)
        .map_err(|error| fault(clip.path(), "INVALID", error.to_string()))?;
    Ok(png.into())
}
