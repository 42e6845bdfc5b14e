//! Names of evaluation protocols. What they do to a picture is the model's business; that
//! they exist, and which of them the service can run, is the contract's.

/// Evaluation protocols, each with what it measures.
pub const PROTOCOLS: &[(&str, &str)] = &[
    (
        HELD_OUT,
        "what training never saw: a capture folder's eval/ and eval_pose/; in the service, the frames that training leaves out",
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

/// The protocol that needs no particular data set, and the only one of the service: it
/// stores what one camera saw, and the others compare with what further cameras saw.
pub const HELD_OUT: &str = "held-out";

/// Whether `name` is a protocol.
pub fn is_protocol(name: &str) -> bool {
    PROTOCOLS.iter().any(|(protocol, _)| *protocol == name)
}
