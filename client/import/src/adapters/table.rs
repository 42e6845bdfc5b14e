//! All formats: what `--from` calls them, which options they read, how their files are recognised, and
//! who reads them.

use super::flags::Flag;
use super::format::Format;
use crate::ImportError;
use crate::datasets::{folder, humannerf, instant_avatar, people_snapshot, zju};
use crate::source::Source;
use crate::tools::{self, Tool, bvh_clip};
use crate::{Imported, Options, film, keypoints};
use std::path::Path;
use std::sync::LazyLock;
use yoto_proto::pose_track::{BINARY_FILE, FILE};

/// A format and its reader.
pub(super) struct Adapter {
    /// What `--from` takes.
    pub from: &'static str,
    pub help: String,
    /// The options that it reads, of those that some formats don't.
    pub flags: Vec<Flag>,
    pub fits: Fits,
    pub read: Read,
}

/// How the files of a format are recognised.
pub(super) enum Fits {
    /// By names in the folder, with what it is called then: all names of one entry must be there.
    Files(&'static [(&'static str, &'static [&'static str])]),
    /// By the file or folder of `--poses`, with what it is called, if its reader doesn't say.
    Poses(Option<&'static str>, fn(&Path) -> bool),
    /// By what is in the file, which is read once for all tools.
    Tool,
    /// A clip without anything beside it.
    Clip,
}

/// The reader of a format.
#[derive(Clone, Copy)]
pub(super) enum Read {
    /// Of a folder.
    Folder(fn(&Source, &Options) -> Result<Imported, ImportError>),
    /// Of a clip, with what the options name.
    Clip(fn(&Path, &Options) -> Result<Imported, ImportError>),
    /// Of a pose tool's files, with the clip.
    Tool(&'static Tool),
}

/// What a pose tool's files need besides.
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
        help: tool.help.into(),
        flags: view.into_iter().chain(TOOL).collect(),
        fits: Fits::Tool,
        read: Read::Tool(tool),
    }
}

/// Formats whose files are recognised before those of pose tools.
fn before_tools() -> [Adapter; 7] {
    [
    Adapter {
        from: Format::FOLDER.name(),
        help: "This project's own: poses.json or poses.pb, frames, masks".into(),
        flags: vec![],
        fits: Fits::Files(&[
            ("a capture folder", &[FILE]),
            ("a capture folder", &[BINARY_FILE]),
        ]),
        read: Read::Folder(folder::read),
    },
    Adapter {
        from: "zju",
        help: "ZJU-MoCap in EasyMocap's layout: annots.npy, new_params, images, mask, mask_cihp".into(),
        flags: vec![Flag::View, Flag::RestJoints, Flag::Fps],
        fits: Fits::Files(&[("ZJU-MoCap", &["annots.npy"])]),
        read: Read::Folder(zju::read),
    },
    Adapter {
        from: "humannerf",
        help: "HumanNeRF: metadata.json of a wild video, or the prepared cameras.pkl, mesh_infos.pkl and canonical_joints.pkl".into(),
        flags: vec![Flag::RestJoints, Flag::Fps],
        fits: Fits::Files(&[
            ("HumanNeRF's prepared capture", &["mesh_infos.pkl"]),
            ("HumanNeRF's wild video", &["metadata.json", "images"]),
        ]),
        read: Read::Folder(humannerf::read),
    },
    Adapter {
        from: "people-snapshot",
        help: "PeopleSnapshot: camera.pkl, masks.hdf5, reconstructed_poses.hdf5 and a video".into(),
        flags: vec![Flag::RestJoints, Flag::Fps],
        fits: Fits::Files(&[("PeopleSnapshot", people_snapshot::MARKS)]),
        read: Read::Folder(people_snapshot::read),
    },
    Adapter {
        from: "instant-avatar",
        help: "InstantAvatar: cameras.npz, poses.npz or poses/*.npz, images, masks".into(),
        flags: vec![Flag::RestJoints, Flag::Poses, Flag::Fps],
        fits: Fits::Files(&[
            ("InstantAvatar", &["cameras.npz", "poses.npz"]),
            ("InstantAvatar", &["cameras.npz", "poses"]),
        ]),
        read: Read::Folder(instant_avatar::read),
    },
    Adapter {
        from: "bvh",
        help: "BVH: --poses a .bvh, with its clip; intri.yml and extri.yml beside it for the camera".into(),
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
        fits: Fits::Poses(Some("BVH"), bvh_clip::fits),
        read: Read::Clip(bvh_clip::read),
    },
    Adapter {
        from: "key-points",
        help: format!(
            "Key points of {}: --poses their files, with the clip; a body is fitted to them",
            keypoints::detectors()
        ),
        flags: vec![
            Flag::Poses,
            Flag::Masks,
            Flag::Matting,
            Flag::Person,
            Flag::Points,
            Flag::TurnPoints,
            Flag::MirrorPoints,
            Flag::Focal,
            Flag::Height,
            Flag::KeepSkeleton,
            Flag::Fps,
            Flag::Hdr,
        ],
        fits: Fits::Poses(None, keypoints::has_files),
        read: Read::Clip(keypoints::read),
    },
    ]
}

/// A clip without anything beside it.
fn clip_alone() -> Adapter {
    Adapter {
        from: Format::FILM.name(),
        help: "A video, or a folder of pictures, alone: poses and masks by --pose-model".into(),
        flags: vec![
            Flag::Masks,
            Flag::Matting,
            Flag::Person,
            Flag::Focal,
            Flag::Height,
            Flag::Fps,
            Flag::Hdr,
        ],
        fits: Fits::Clip,
        read: Read::Clip(film::read),
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
