//! All formats: what `--from` calls them, which options they read, how their files are recognised, and
//! who reads them.

use super::flags::Flag;
use super::format::Format;
use crate::datasets::{folder, humannerf, instant_avatar, people_snapshot, zju};
use crate::source::Source;
use crate::tools::{Tool, bvh_clip};
use crate::tools::{easymocap, ex_avatar, gvhmr, lhm, phalp, prompthmr, romp, tram, wham};
use crate::{Imported, Options, film, keypoints};
use clap::builder::PossibleValue;
use std::path::Path;
use yoto_client::ClientError;
use yoto_proto::pose_track::{BINARY_FILE, FILE};

/// A format and its reader.
pub(super) struct Adapter {
    pub format: Format,
    /// What `--from` takes.
    pub from: &'static str,
    pub help: &'static str,
    /// The options that it reads, of those that some formats don't.
    pub flags: &'static [Flag],
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
    Folder(fn(&Source, &Options) -> Result<Imported, ClientError>),
    /// Of a clip, with what the options name.
    Clip(fn(&Path, &Options) -> Result<Imported, ClientError>),
    /// Of a pose tool's files, with the clip.
    Tool(&'static Tool),
}

/// What a pose tool's files need besides.
const TOOL: &[Flag] = &[
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
pub(super) static ADAPTERS: [Adapter; 17] = [
    Adapter {
        format: Format::Folder,
        from: "folder",
        help: "This project's own: poses.json or poses.pb, frames, masks",
        flags: &[],
        fits: Fits::Files(&[
            ("a capture folder", &[FILE]),
            ("a capture folder", &[BINARY_FILE]),
        ]),
        read: Read::Folder(folder::read),
    },
    Adapter {
        format: Format::Zju,
        from: "zju",
        help: "ZJU-MoCap in EasyMocap's layout: annots.npy, new_params, images, mask, mask_cihp",
        flags: &[Flag::View, Flag::RestJoints, Flag::Fps],
        fits: Fits::Files(&[("ZJU-MoCap", &["annots.npy"])]),
        read: Read::Folder(zju::read),
    },
    Adapter {
        format: Format::HumanNerf,
        from: "humannerf",
        help: "HumanNeRF: metadata.json of a wild video, or the prepared cameras.pkl, mesh_infos.pkl and canonical_joints.pkl",
        flags: &[Flag::RestJoints, Flag::Fps],
        fits: Fits::Files(&[
            ("HumanNeRF's prepared capture", &["mesh_infos.pkl"]),
            ("HumanNeRF's wild video", &["metadata.json", "images"]),
        ]),
        read: Read::Folder(humannerf::read),
    },
    Adapter {
        format: Format::PeopleSnapshot,
        from: "people-snapshot",
        help: "PeopleSnapshot: camera.pkl, masks.hdf5, reconstructed_poses.hdf5 and a video",
        flags: &[Flag::RestJoints, Flag::Fps],
        fits: Fits::Files(&[("PeopleSnapshot", people_snapshot::MARKS)]),
        read: Read::Folder(people_snapshot::read),
    },
    Adapter {
        format: Format::InstantAvatar,
        from: "instant-avatar",
        help: "InstantAvatar: cameras.npz, poses.npz or poses/*.npz, images, masks",
        flags: &[Flag::RestJoints, Flag::Poses, Flag::Fps],
        fits: Fits::Files(&[
            ("InstantAvatar", &["cameras.npz", "poses.npz"]),
            ("InstantAvatar", &["cameras.npz", "poses"]),
        ]),
        read: Read::Folder(instant_avatar::read),
    },
    Adapter {
        format: Format::Bvh,
        from: "bvh",
        help: "BVH: --poses a .bvh, with its clip; intri.yml and extri.yml beside it for the camera",
        flags: &[
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
        format: Format::KeyPoints,
        from: "key-points",
        help: "Key points of OpenPose, AlphaPose, MMPose, easy_ViTPose, MediaPipe or SAM 3D Body: --poses their files, with the clip; a body is fitted to them",
        flags: &[
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
    Adapter {
        format: Format::Phalp,
        from: "phalp",
        help: "4D-Humans' tracker PHALP: --poses outputs/results/demo_*.pkl, with its video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&phalp::TOOL),
    },
    Adapter {
        format: Format::Wham,
        from: "wham",
        help: "WHAM: --poses wham_output.pkl, with its video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&wham::TOOL),
    },
    Adapter {
        format: Format::Gvhmr,
        from: "gvhmr",
        help: "GVHMR: --poses hmr4d_results.pt, with its video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&gvhmr::TOOL),
    },
    Adapter {
        format: Format::Tram,
        from: "tram",
        help: "TRAM: --poses results/CLIP, with its video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&tram::TOOL),
    },
    Adapter {
        format: Format::Romp,
        from: "romp",
        help: "ROMP or BEV: --poses a folder of *.npz or video_results.npz, with its video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&romp::TOOL),
    },
    Adapter {
        format: Format::PromptHmr,
        from: "prompthmr",
        help: "PromptHMR: --poses results.pkl, with its video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&prompthmr::TOOL),
    },
    Adapter {
        format: Format::Lhm,
        from: "lhm",
        help: "LHM's motions: --poses smplx_params, with their video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&lhm::TOOL),
    },
    Adapter {
        format: Format::ExAvatar,
        from: "exavatar",
        help: "ExAvatar: --poses smplx_optimized/smplx_params, with the pictures or their video",
        flags: TOOL,
        fits: Fits::Tool,
        read: Read::Tool(&ex_avatar::TOOL),
    },
    Adapter {
        format: Format::EasyMocap,
        from: "easymocap",
        help: "EasyMocap: --poses a folder with smpl, intri.yml and extri.yml, with one view's video",
        flags: &[
            Flag::View,
            Flag::RestJoints,
            Flag::Poses,
            Flag::Masks,
            Flag::Matting,
            Flag::Person,
            Flag::Focal,
            Flag::Height,
            Flag::Fps,
            Flag::Hdr,
        ],
        fits: Fits::Tool,
        read: Read::Tool(&easymocap::TOOL),
    },
    Adapter {
        format: Format::Film,
        from: "film",
        help: "A video, or a folder of pictures, alone: poses and masks by --pose-model",
        flags: &[
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
    },
];

/// The adapter of `format`; `None` for [`Format::Auto`].
pub(super) fn of(format: Format) -> Option<&'static Adapter> {
    ADAPTERS.iter().find(|adapter| adapter.format == format)
}

/// The formats that read `flag`, by the names that `--from` takes.
pub(super) fn readers(flag: Flag) -> Vec<&'static str> {
    let reads = ADAPTERS
        .iter()
        .filter(|adapter| adapter.flags.contains(&flag));
    reads.map(|adapter| adapter.from).collect()
}

impl clap::ValueEnum for Format {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: [Format; ADAPTERS.len() + 1] = {
            let mut all = [Format::Auto; ADAPTERS.len() + 1];
            let mut at = 0;
            while at < ADAPTERS.len() {
                all[at + 1] = ADAPTERS[at].format;
                at += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (from, help) = match of(*self) {
            Some(adapter) => (adapter.from, adapter.help),
            None => ("auto", "Recognised by the files"),
        };
        Some(PossibleValue::new(from).help(help))
    }
}
