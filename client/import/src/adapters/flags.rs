//! The options of an import that some formats don't read.

use crate::Options;
use yoto_media::video::Hdr;

/// An option that some formats don't read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flag {
    View,
    RestJoints,
    Poses,
    Masks,
    Matting,
    Person,
    Points,
    PointRotation,
    MirrorPoints,
    Focal,
    Height,
    KeepSkeleton,
    NoHands,
    NoFace,
    Fps,
    Hdr,
}

/// An option, its name, and whether it is given.
type FlagRow = (Flag, &'static str, fn(&Options) -> bool);

/// All options that some formats do not read, in the order of the help.
pub(super) const FLAGS: [FlagRow; 16] = [
    (Flag::View, "--view", |it| it.camera.is_some()),
    (Flag::RestJoints, "--rest-joints", |it| {
        it.rest_joints.is_some()
    }),
    (Flag::Poses, "--poses", |it| it.poses.is_some()),
    (Flag::Masks, "--masks", |it| it.masks.is_some()),
    (Flag::Matting, "--matting-model", |it| it.matting.is_some()),
    (Flag::Person, "--person", |it| it.person.is_some()),
    (Flag::Points, "--points", |it| it.points.is_some()),
    (Flag::PointRotation, "--turn-points", |it| {
        it.point_rotation.is_some()
    }),
    (Flag::MirrorPoints, "--mirror-points", |it| it.mirror_points),
    (Flag::Focal, "--focal", |it| it.focal.is_some()),
    (Flag::Height, "--height", |it| it.height.is_some()),
    (Flag::KeepSkeleton, "--keep-skeleton", |it| it.keep_skeleton),
    (Flag::NoHands, "--no-hands", |it| it.no_hands),
    (Flag::NoFace, "--no-face", |it| it.no_face),
    (Flag::Fps, "--fps", |it| it.fps.is_some()),
    (Flag::Hdr, "--hdr", |it| it.hdr != Hdr::Auto),
];
