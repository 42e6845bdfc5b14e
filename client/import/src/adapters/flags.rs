//! The options of an import that some formats don't read.

use crate::Options;

/// An option that some formats don't read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flag {
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

/// All of them, in the order in which help lists them.
pub(super) const FLAGS: [Flag; 10] = [
    Flag::View,
    Flag::RestJoints,
    Flag::Poses,
    Flag::Masks,
    Flag::Matting,
    Flag::Person,
    Flag::Focal,
    Flag::Height,
    Flag::KeepSkeleton,
    Flag::Fps,
];

impl Flag {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::View => "--view",
            Self::RestJoints => "--rest-joints",
            Self::Poses => "--poses",
            Self::Masks => "--masks",
            Self::Matting => "--matting-model",
            Self::Person => "--person",
            Self::Focal => "--focal",
            Self::Height => "--height",
            Self::KeepSkeleton => "--keep-skeleton",
            Self::Fps => "--fps",
        }
    }

    pub(super) fn is_given(self, options: &Options) -> bool {
        match self {
            Self::View => options.camera.is_some(),
            Self::RestJoints => options.rest_joints.is_some(),
            Self::Poses => options.poses.is_some(),
            Self::Masks => options.masks.is_some(),
            Self::Matting => options.matting.is_some(),
            Self::Person => options.person.is_some(),
            Self::Focal => options.focal.is_some(),
            Self::Height => options.height.is_some(),
            Self::KeepSkeleton => options.keep_skeleton,
            Self::Fps => options.fps.is_some(),
        }
    }
}
