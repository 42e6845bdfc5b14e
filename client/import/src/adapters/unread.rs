//! An option that a format does not read is an error, since the user expects it to have an effect.
//!
//! `--range`, `--best` and `--ffmpeg` are read with every format. `--smpl` and `--pose-model` may come
//! from the environment, for all commands, so that they are ignored where they have no use.

use super::flags::{FLAGS, Flag};
use super::format::Format;
use super::table::{Adapter, readers};
use crate::{ImportError, Options};
use std::path::Path;
use yoto_proto::pose_track::violation;

/// Checks that `adapter`, the format of `source`, reads every given option.
///
/// # Errors
/// The first option that is not, with the formats that read it.
pub(super) fn ensure_read(
    adapter: &Adapter,
    source: &Path,
    options: &Options,
) -> Result<(), ImportError> {
    let mut given = FLAGS.into_iter().filter(|(_, _, given)| given(options));
    let Some((flag, name, _)) = given.find(|(flag, ..)| !adapter.flags.contains(flag)) else {
        return Ok(());
    };
    let others = readers(flag);
    let mut message = format!(
        "is read as {}, which does not read {name}: {} {}",
        adapter.from,
        others.join(", "),
        if others.len() == 1 { "does" } else { "do" }
    );
    if flag == Flag::KeepSkeleton {
        message += if adapter.from == Format::FILM.name() {
            ". The pose model finds points, which have no tree of joints to keep"
        } else if adapter.from == Format::FOLDER.name() {
            ". A capture keeps its joints"
        } else {
            ". Its skeleton is SMPL's own, or SMPL-X's, whose body has SMPL's joints"
        };
    }
    let file = source.file_name().unwrap_or_default().to_string_lossy();
    let folder = source.parent().unwrap_or(Path::new(""));
    Err(ImportError::BadCapture {
        place: folder.display().to_string(),
        violations: vec![violation("UNREAD_OPTION", &file, None, name, message)],
    })
}

#[cfg(test)]
mod tests {
    use super::super::table::{adapters, of};
    use super::*;

    #[test]
    fn an_option_that_is_not_read_is_named_with_the_formats_that_read_it() {
        let refused = |name, options: &Options| {
            let format = Format::named(name).expect("a name");
            let checked = ensure_read(
                of(format).expect("a row"),
                Path::new("captures/377"),
                options,
            );
            checked.map_err(|error| error.to_string())
        };
        let person = Options {
            person: Some("2".into()),
            ..Options::default()
        };
        let text = refused("zju", &person).expect_err("no people");
        assert!(
            text.contains("377")
                && text
                    .contains("is read as zju, which does not read --person: key-points, phalp,"),
            "{text}"
        );
        assert!(text.contains("easymocap, film do"), "{text}");
        assert!(!text.contains("humannerf"), "{text}");
        assert_eq!(refused("film", &person), Ok(()));
        assert_eq!(refused("wham", &person), Ok(()));
        let view = Options {
            camera: Some(1),
            ..Options::default()
        };
        assert_eq!(refused("easymocap", &view), Ok(()));
        assert!(refused("wham", &view).is_err());
        let everywhere = Options {
            frames: Some((0, 2, 1)),
            best: std::num::NonZeroUsize::new(3),
            body_model: Some("SMPL.npz".into()),
            pose_model: Some("models".into()),
            ffmpeg: Some("ffmpeg".into()),
            ..Options::default()
        };
        for adapter in adapters() {
            assert_eq!(refused(adapter.from, &everywhere), Ok(()));
        }
    }
}
