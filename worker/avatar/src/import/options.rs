//! Settings of HumanNeRF's training that its checkpoints do not have.

/// Settings of the program's configuration file, which its checkpoints don't hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HumanNerfOptions {
    /// Samples per ray (`N_samples`).
    pub samples: usize,
    /// Iteration from which the non-rigid field takes part
    /// (`non_rigid_motion_mlp.kick_in_iter`).
    pub kick_in: u64,
    /// Iteration from which all its bands are open (`non_rigid_motion_mlp.full_band_iter`).
    pub full_band: u64,
}

impl HumanNerfOptions {
    /// The program's for ZJU-MoCap (`configs/default.yaml`).
    pub const ZJU_MOCAP: Self = Self {
        samples: 128,
        kick_in: 10_000,
        full_band: 50_000,
    };
}

impl Default for HumanNerfOptions {
    fn default() -> Self {
        Self::ZJU_MOCAP
    }
}
