//! The names of formats.

/// Format of a capture. `--from` takes it by the name that the table of adapters gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// Recognised by the files.
    #[default]
    Auto,
    /// ZJU-MoCap.
    Zju,
    /// HumanNeRF.
    HumanNerf,
    /// PeopleSnapshot.
    PeopleSnapshot,
    /// InstantAvatar.
    InstantAvatar,
    /// This project's own capture folder.
    Folder,
    /// A video, or a folder of pictures, alone.
    Film,
    /// 4D-Humans' tracker PHALP.
    Phalp,
    /// WHAM.
    Wham,
    /// GVHMR.
    Gvhmr,
    /// TRAM.
    Tram,
    /// ROMP or BEV.
    Romp,
    /// PromptHMR.
    PromptHmr,
    /// LHM's motions.
    Lhm,
    /// ExAvatar.
    ExAvatar,
    /// EasyMocap.
    EasyMocap,
    /// BVH.
    Bvh,
    /// Key points of a detector.
    KeyPoints,
}
