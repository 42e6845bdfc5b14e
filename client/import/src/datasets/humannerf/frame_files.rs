//! The files of a frame, which have the same names in both forms of a capture.

use crate::ImportError;
use crate::pictures::{Mask, MaskKind, PictureFiles};
use crate::source::Source;

/// The image and the mask of a frame by its name.
pub(super) fn files(source: &Source, name: &str, frame: u32) -> Result<PictureFiles, ImportError> {
    if name.is_empty() || name.contains(['/', '\\']) || name.contains("..") {
        let message = format!("'{name}' is not a file name");
        return Err(source.fault("BAD_NAME", "images", Some(frame), name, message));
    }
    let find = |folder: &str| {
        let names = ["png", "jpg"].map(|ending| format!("{folder}/{name}.{ending}"));
        match names.iter().find(|name| source.has(name)) {
            Some(found) => Ok(source.path(found)),
            None => {
                let message = "there is no such file";
                Err(source.fault("MISSING", &names[0], Some(frame), "", message))
            }
        }
    };
    Ok(PictureFiles {
        image: find("images")?,
        masks: vec![Mask::Image(find("masks")?, MaskKind::Coverage)],
        over_black: false,
    })
}
