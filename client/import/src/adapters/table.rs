//! All formats: their names for `--from`, the options that they read, the recognition of their files, and their readers.

use super::flags::Flag;
use super::format::Format;
use crate::datasets::{folder, humannerf, instant_avatar, people_snapshot, zju};
use crate::source::Source;
use crate::tools::{self, Tool, bvh_clip};
use crate::{ImportError, Imported, Options, film, keypoints};
use std::path::Path;
use std::sync::LazyLock;
use yoto_proto::pose_track::{BINARY_FILE, FILE};

/// A format and its reader.
pub(super) struct Adapter {
    /// What `--from` takes.
    pub from: &'static str,
    pub help: &'static str,
    /// The options in [`FLAGS`](super::flags::FLAGS) that it reads.
    pub flags: Vec<Flag>,
    pub fits: RecognisedBy,
    pub read: Reader,
}

/// How the files of a format are recognised.
pub(super) enum RecognisedBy {
    /// By names in the folder: each entry has a name for a note, and files that must all be there.
    Files(&'static [(&'static str, &'static [&'static str])]),
    /// By the file or folder of `--poses`; with a name for a note, unless the reader names it.
    Poses(Option<&'static str>, fn(&Path) -> bool),
    /// By the contents of the file, which is read once for all tools.
    Tool,
    /// A clip with no other files.
    Clip,
}

/// The reader of a format.
#[derive(Clone, Copy)]
pub(super) enum Reader {
    /// Reads a folder.
    Folder(fn(&Source, &Options) -> Result<Imported, ImportError>),
    /// Reads a clip and the files that the options name.
    Clip(fn(&Path, &Options) -> Result<Imported, ImportError>),
    /// Reads a pose tool's files with their clip.
    Tool(&'static Tool),
}

/// The options that are read with every pose tool's files.
const TOOL: [Flag; 9] = [
    Flag::RestJoints,
    Flag::Poses,
    Flag::Masks,
    Flag::Matting,
    Flag::Person,
    Flag::Focal,
    Flag::Height,
    Flag::Fps,
    Flag::Hdr,
];

/// All formats, in the order in which files are recognised: an import's own capture folder may be the
/// folder of the dataset, and a clip is all that is left where nothing else fits.
pub(super) fn adapters() -> &'static [Adapter] {
    static ALL: LazyLock<Vec<Adapter>> = LazyLock::new(|| {
        let tools = tools::ALL.into_iter().map(of_tool);
        let others = before_tools().into_iter();
        others.chain(tools).chain([clip_alone()]).collect()
    });
    &ALL
}

fn of_tool(tool: &'static Tool) -> Adapter {
    let view = tool.has_views.then_some(Flag::View);
    Adapter {
        from: tool.from,
        help: tool.help,
        flags: view.into_iter().chain(TOOL).collect(),
        fits: RecognisedBy::Tool,
        read: Reader::Tool(tool),
    }
}

/// Formats whose files are recognised before those of pose tools.
fn before_tools() -> [Adapter; 7] {
    [
        Adapter {
            from: Format::FOLDER.name(),
            help: "This project's own: poses.json or poses.pb, frames, masks",
            flags: vec![],
            fits: RecognisedBy::Files(&[
                ("a capture folder", &[FILE]),
                ("a capture folder", &[BINARY_FILE]),
            ]),
            read: Reader::Folder(folder::read),
        },
        Adapter {
            from: "zju",
            help: "ZJU-MoCap in EasyMocap's layout: annots.npy, new_params, images, mask, mask_cihp",
            flags: vec![Flag::View, Flag::RestJoints, Flag::Fps],
            fits: RecognisedBy::Files(&[("ZJU-MoCap", &["annots.npy"])]),
            read: Reader::Folder(zju::read),
        },
        Adapter {
            from: "humannerf",
            help: "HumanNeRF: metadata.json of a wild video, or the prepared cameras.pkl, mesh_infos.pkl and canonical_joints.pkl",
            flags: vec![Flag::RestJoints, Flag::Fps],
            fits: RecognisedBy::Files(&[
                ("HumanNeRF's prepared capture", &["mesh_infos.pkl"]),
                ("HumanNeRF's wild video", &["metadata.json", "images"]),
            ]),
            read: Reader::Folder(humannerf::read),
        },
        Adapter {
            from: "people-snapshot",
            help: "PeopleSnapshot: camera.pkl, masks.hdf5, reconstructed_poses.hdf5 and a video",
            flags: vec![Flag::RestJoints, Flag::Fps],
            fits: RecognisedBy::Files(&[("PeopleSnapshot", people_snapshot::MARKS)]),
            read: Reader::Folder(people_snapshot::read),
        },
        Adapter {
            from: "instant-avatar",
            help: "InstantAvatar: cameras.npz, poses.npz or poses/*.npz, images, masks",
            flags: vec![Flag::RestJoints, Flag::Poses, Flag::Fps],
            fits: RecognisedBy::Files(&[
                ("InstantAvatar", &["cameras.npz", "poses.npz"]),
                ("InstantAvatar", &["cameras.npz", "poses"]),
            ]),
            read: Reader::Folder(instant_avatar::read),
        },
        Adapter {
            from: "bvh",
            help: "BVH: --poses a .bvh, with its clip; intri.yml and extri.yml beside it for the camera",
            flags: vec![
                Flag::View,
                Flag::Poses,
                Flag::Masks,
                Flag::Matting,
                Flag::Focal,
                Flag::KeepSkeleton,
                Flag::Fps,
                Flag::Hdr,
            ],
            fits: RecognisedBy::Poses(Some("BVH"), bvh_clip::fits),
            read: Reader::Clip(bvh_clip::read),
        },
        Adapter {
            from: "key-points",
            help: keypoints::help(),
            flags: vec![
                Flag::Poses,
                Flag::Masks,
                Flag::Matting,
                Flag::Person,
                Flag::Points,
                Flag::PointRotation,
                Flag::MirrorPoints,
                Flag::Focal,
                Flag::Height,
                Flag::KeepSkeleton,
                Flag::Fps,
                Flag::Hdr,
            ],
            fits: RecognisedBy::Poses(None, keypoints::has_files),
            read: Reader::Clip(keypoints::read),
        },
    ]
}

/// A clip without anything beside it.
fn clip_alone() -> Adapter {
    Adapter {
        from: Format::FILM.name(),
        help: "A video, or a folder of pictures, alone: poses and masks by --pose-model",
        flags: vec![
            Flag::Masks,
            Flag::Matting,
            Flag::Person,
            Flag::Focal,
            Flag::Height,
            Flag::NoHands,
            Flag::NoFace,
            Flag::Fps,
            Flag::Hdr,
        ],
        fits: RecognisedBy::Clip,
        read: Reader::Clip(film::read),
    }
}

/// The adapter of `format`; `None` for [`Format::AUTO`].
pub(super) fn of(format: Format) -> Option<&'static Adapter> {
    let mut all = adapters().iter();
    all.find(|adapter| adapter.from == format.name())
}

/// The formats that read `flag`, by the names that `--from` takes.
pub(super) fn readers(flag: Flag) -> Vec<&'static str> {
    let reads = adapters()
        .iter()
        .filter(|adapter| adapter.flags.contains(&flag));
    reads.map(|adapter| adapter.from).collect()
}
