//! Which options each format reads: one that a format does not read is an error, since a file in its
//! place would be another's.
//!
//! `--range`, `--best` and `--ffmpeg` are read with every format. `--smpl` and `--pose-model` may come
//! from the environment, for all commands, so that they are ignored where they have no use.

use super::{Format, Options};
use clap::ValueEnum;
use std::path::Path;
use yoto_client::ClientError;
use yoto_proto::pose_track::violation;

/// An option that some formats don't read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flag {
    View,
    RestJoints,
    Poses,
    Masks,
    Matting,
    Person,
    Focal,
    Height,
    KeepSkeleton,
    Fps,
}

use Flag::{Focal, Fps, Height, KeepSkeleton, Masks, Matting, Person, Poses, RestJoints, View};

const FLAGS: [Flag; 10] = [
    View,
    RestJoints,
    Poses,
    Masks,
    Matting,
    Person,
    Focal,
    Height,
    KeepSkeleton,
    Fps,
];

impl Flag {
    fn name(self) -> &'static str {
        match self {
            View => "--view",
            RestJoints => "--rest-joints",
            Poses => "--poses",
            Masks => "--masks",
            Matting => "--matting-model",
            Person => "--person",
            Focal => "--focal",
            Height => "--height",
            KeepSkeleton => "--keep-skeleton",
            Fps => "--fps",
        }
    }

    fn is_given(self, options: &Options) -> bool {
        match self {
            View => options.camera.is_some(),
            RestJoints => options.rest_joints.is_some(),
            Poses => options.poses.is_some(),
            Masks => options.masks.is_some(),
            Matting => options.matting.is_some(),
            Person => options.person.is_some(),
            Focal => options.focal.is_some(),
            Height => options.height.is_some(),
            KeepSkeleton => options.keep_skeleton,
            Fps => options.fps.is_some(),
        }
    }

    /// The formats that read it, by the names that `--from` takes.
    fn readers(self) -> Vec<String> {
        let formats = Format::value_variants().iter();
        let reads = formats.filter(|format| read_by(**format).contains(&self));
        reads.map(|format| name(*format)).collect()
    }
}

/// What a pose tool's files need besides.
const TOOL: &[Flag] = &[
    RestJoints, Poses, Masks, Matting, Person, Focal, Height, Fps,
];

/// The options that `format` reads.
fn read_by(format: Format) -> &'static [Flag] {
    match format {
        // What is recognised is checked as the format that it is.
        Format::Auto | Format::Folder => &[],
        Format::Zju => &[View, RestJoints, Fps],
        Format::HumanNerf | Format::PeopleSnapshot => &[RestJoints, Fps],
        Format::InstantAvatar => &[RestJoints, Poses, Fps],
        Format::Film => &[Masks, Matting, Focal, Height, Fps],
        Format::KeyPoints => &[
            Poses,
            Masks,
            Matting,
            Person,
            Focal,
            Height,
            KeepSkeleton,
            Fps,
        ],
        Format::Bvh => &[View, Poses, Masks, Matting, Focal, KeepSkeleton, Fps],
        Format::EasyMocap => &[
            View, RestJoints, Poses, Masks, Matting, Person, Focal, Height, Fps,
        ],
        Format::Phalp
        | Format::Wham
        | Format::Gvhmr
        | Format::Tram
        | Format::Romp
        | Format::PromptHmr
        | Format::Lhm
        | Format::ExAvatar => TOOL,
    }
}

/// The name that `--from` takes.
fn name(format: Format) -> String {
    let value = format.to_possible_value();
    value.map_or_else(String::new, |value| value.get_name().to_owned())
}

/// Checks that every given option is read by `format`, in which `source` is.
///
/// # Errors
/// The first option that is not, with the formats that read it.
pub(super) fn ensure_read(
    format: Format,
    source: &Path,
    options: &Options,
) -> Result<(), ClientError> {
    let unread = |flag: &Flag| flag.is_given(options) && !read_by(format).contains(flag);
    let Some(flag) = FLAGS.into_iter().find(unread) else {
        return Ok(());
    };
    let mut message = format!(
        "is read as {}, which does not read {}: {}",
        name(format),
        flag.name(),
        flag.readers().join(", ")
    );
    message += if flag.readers().len() == 1 {
        " does"
    } else {
        " do"
    };
    if (format, flag) == (Format::Film, Person) {
        message += ". In a clip alone the pose model takes the most certain person; to choose among \
                    several, give a pose tool's files or key points (--poses), or cut the clip so that it \
                    shows one";
    }
    if flag == KeepSkeleton {
        message += match format {
            Format::Film => ". The pose model finds points, which have no tree of joints to keep",
            Format::Folder => ". A capture keeps its joints",
            _ => ". Its skeleton is SMPL's own, or SMPL-X's, whose body has SMPL's joints",
        };
    }
    let file = source.file_name().unwrap_or_default().to_string_lossy();
    let place = source.parent().unwrap_or(Path::new(""));
    Err(ClientError::BadCapture {
        place: place.display().to_string(),
        violations: vec![violation(
            "UNREAD_OPTION",
            &file,
            None,
            flag.name(),
            message,
        )],
    })
}

/// The table for `--help`: each option with the formats that read it.
pub fn options_by_format() -> String {
    let widest = FLAGS.iter().map(|flag| flag.name().len()).max();
    let width = widest.unwrap_or_default();
    let line = |flag: Flag| {
        let mut line = format!("  {:width$} ", flag.name());
        let mut column = line.len();
        for (at, format) in flag.readers().iter().enumerate() {
            let word = if at == 0 {
                format!(" {format}")
            } else {
                format!(", {format}")
            };
            if column + word.len() > 98 {
                line += &format!(",\n{:1$}", "", width + 4);
                line += format;
                column = width + 4 + format.len();
            } else {
                column += word.len();
                line += &word;
            }
        }
        line + "\n"
    };
    let lines: String = FLAGS.into_iter().map(line).collect();
    format!("Options that only some formats read, and are errors with others:\n{lines}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_that_is_not_read_is_named_with_the_formats_that_read_it() {
        let refused = |format, options: &Options| {
            let checked = ensure_read(format, Path::new("captures/377"), options);
            checked.map_err(|error| error.to_string())
        };
        let person = Options {
            person: Some("2".into()),
            ..Options::default()
        };
        let text = refused(Format::Zju, &person).expect_err("no people");
        assert!(
            text.contains("377")
                && text.contains("is read as zju, which does not read --person: phalp,"),
            "{text}"
        );
        assert!(text.contains("key-points do"), "{text}");
        assert!(!text.contains("humannerf"), "{text}");
        let text = refused(Format::Film, &person).expect_err("no names");
        assert!(text.contains("give a pose tool's files"), "{text}");
        assert_eq!(refused(Format::Wham, &person), Ok(()));
        let view = Options {
            camera: Some(1),
            ..Options::default()
        };
        assert_eq!(refused(Format::EasyMocap, &view), Ok(()));
        assert!(refused(Format::Wham, &view).is_err());
        let everywhere = Options {
            frames: Some((0, 2, 1)),
            best: std::num::NonZeroUsize::new(3),
            body_model: Some("SMPL.npz".into()),
            pose_model: Some("models".into()),
            ffmpeg: Some("ffmpeg".into()),
            ..Options::default()
        };
        for format in Format::value_variants() {
            assert_eq!(refused(*format, &everywhere), Ok(()));
        }
    }

    #[test]
    fn the_help_has_every_option_and_fits() {
        let help = options_by_format();
        for flag in FLAGS {
            assert!(help.contains(&format!("  {} ", flag.name())), "{help}");
        }
        assert!(help.lines().all(|line| line.len() <= 100), "{help}");
        assert!(
            help.contains("--view           zju, easymocap, bvh\n"),
            "{help}"
        );
    }
}
