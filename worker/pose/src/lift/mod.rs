//! The depth of key points, by a network that has seen how people move.
//!
//! A detector's depth is poor, and each frame is guessed by itself. The network sees the key points of two seconds and the detector's
//! depths, and returns the depth of each point with the uncertainty of each bone. It is learned from motions, which random cameras
//! project, and from the measured errors of a detector ([`learn`]).

mod deepen;
pub mod learn;
pub mod network;
pub(crate) mod points;
mod window;

pub(crate) use deepen::deepen;
pub use points::{BLAZE as POINTS, BONE_COUNT, BONES, COUNT, HIPS, mirrored};
pub use window::{INPUTS, Sighting, told_depth, window};

use network::Network;
use std::sync::OnceLock;

/// Learned by `yoto-lab lift` (docs/research/poses.md); the motions are named in `NOTICE-motions`.
static OWN: &[u8] = include_bytes!("lift.safetensors");

/// The network that the program has.
///
/// # Panics
/// Never: a test reads the file.
pub(crate) fn own() -> &'static Network {
    static NETWORK: OnceLock<Network> = OnceLock::new();
    NETWORK.get_or_init(|| {
        Network::from_bytes(OWN).expect("a test reads the file that the program is built with")
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_program_has_a_network() {
        super::own();
    }
}
