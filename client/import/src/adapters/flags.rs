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
    TurnPoints,
    MirrorPoints,
    Focal,
    Height,
    KeepSkeleton,
    Fps,
    Hdr,
}

/// An option, its name, and whether it is given.
type Row = (Flag, &'static str, fn(&Options) -> bool);

/// All of them, in the order in which help lists them.
pub(super) const FLAGS: [Row; 14] = [
    (Flag::View, "--view", |it| it.camera.is_some()),
    (Flag::RestJoints, "--rest-joints", |it| {
        it.rest_joints.is_some()
    }),
    (Flag::Poses, "--poses", |it| it.poses.is_some()),
    (Flag::Masks, "--masks", |it| it.masks.is_some()),
    (Flag::Matting, "--matting-model", |it| it.matting.is_some()),
    (Flag::Person, "--person", |it| it.person.is_some()),
    (Flag::Points, "--points", |it| it.points.is_some()),
    (Flag::TurnPoints, "--turn-points", |it| {
        it.turn_points.is_some()
    }),
    (Flag::MirrorPoints, "--mirror-points", |it| it.mirror_points),
    (Flag::Focal, "--focal", |it| it.focal.is_some()),
    (Flag::Height, "--height", |it| it.height.is_some()),
    (Flag::KeepSkeleton, "--keep-skeleton", |it| it.keep_skeleton),
    (Flag::Fps, "--fps", |it| it.fps.is_some()),
    (Flag::Hdr, "--hdr", |it| it.hdr != Hdr::Auto),
];
