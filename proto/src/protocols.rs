//! Names of evaluation protocols. The model crate implements them; the contract has their
//! names, and the one that the service can run.

/// Evaluation protocols, each with a description.
pub const PROTOCOLS: &[(&str, &str)] = &[
    (
        HELD_OUT,
        "held-out pictures: a capture folder's eval/ and eval_pose/; in the service, the frames that training leaves out",
    ),
    (
        "zju-all",
        "the paper's: six ZJU-MoCap subjects, all frames of the other cameras, 512 pixels",
    ),
    (
        "zju-step30",
        "HumanNeRF's author's: every 30th frame, black outside the person's projected box",
    ),
    (
        "snapshot",
        "PeopleSnapshot, 22 videos in one model: pictures to look at, no figures",
    ),
];

/// The protocol that needs no particular data set. It is the only one of the service, which stores the pictures of
/// one camera: the other protocols need pictures of further cameras.
pub const HELD_OUT: &str = "held-out";

/// Whether `name` is a protocol.
pub fn is_protocol(name: &str) -> bool {
    PROTOCOLS.iter().any(|(protocol, _)| *protocol == name)
}
