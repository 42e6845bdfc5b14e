//! Evaluation protocols as data: which pictures are measured, and what is done to them first.
//!
//! Their names are the contract's ([`yoto_proto::protocols`]). Data sets are not part of this
//! program; a protocol says what a capture made of one must hold.

use thiserror::Error;
use yoto_proto::protocols;

/// A way to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Protocol {
    /// As on the command line.
    pub name: &'static str,
    /// Subjects of the data set; empty where any will do.
    pub subjects: &'static [&'static str],
    /// Index of the one camera that training sees, where the data set has several. All
    /// others are measured.
    pub train_camera: Option<u32>,
    /// Which held-out pictures count.
    pub pictures: Pictures,
    /// Only frames whose number is a multiple of this count.
    pub frame_step: u32,
    /// Longest side that pictures are compared at, pixels; 0 leaves it to whoever measures.
    pub image_size: u32,
    /// Pixels outside the person's projected box are black in both pictures.
    pub black_outside_box: bool,
    /// Whether figures were ever published by it; where not, pictures are for looking at.
    pub figures: bool,
}

/// The kinds of held-out pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pictures {
    /// Poses that were trained on, from other cameras.
    Views,
    /// Those, and poses that were never trained on.
    ViewsAndPoses,
}

/// No protocol has this name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "there is no protocol '{0}'; protocols: {list}",
    list = yoto_proto::tiers::listed(protocols::PROTOCOLS)
)]
pub struct UnknownProtocol(String);

/// The six ZJU-MoCap subjects of the paper.
const ZJU: &[&str] = &["377", "386", "387", "392", "393", "394"];

/// Pictures are compared over black in every protocol, so none says it.
pub const PROTOCOLS: &[Protocol] = &[
    Protocol {
        name: protocols::HELD_OUT,
        subjects: &[],
        train_camera: None,
        pictures: Pictures::ViewsAndPoses,
        frame_step: 1,
        image_size: 0,
        black_outside_box: false,
        figures: true,
    },
    Protocol {
        name: "zju-all",
        subjects: ZJU,
        train_camera: Some(0),
        pictures: Pictures::Views,
        frame_step: 1,
        image_size: 512,
        black_outside_box: false,
        figures: true,
    },
    Protocol {
        name: "zju-step30",
        subjects: ZJU,
        train_camera: Some(0),
        pictures: Pictures::Views,
        frame_step: 30,
        image_size: 512,
        black_outside_box: true,
        figures: true,
    },
    Protocol {
        name: "snapshot",
        subjects: &[],
        train_camera: None,
        pictures: Pictures::ViewsAndPoses,
        frame_step: 1,
        image_size: 0,
        black_outside_box: false,
        figures: false,
    },
];

impl Protocol {
    /// The protocol called `name`.
    ///
    /// # Errors
    /// When there is none; the message lists what there is.
    pub fn named(name: &str) -> Result<&'static Self, UnknownProtocol> {
        let found = PROTOCOLS.iter().find(|protocol| protocol.name == name);
        found.ok_or_else(|| UnknownProtocol(name.to_owned()))
    }

    /// Whether pictures of the frame numbered `frame` count.
    pub fn takes(&self, frame: u32) -> bool {
        frame.is_multiple_of(self.frame_step)
    }

    /// The longest side that pictures are compared at when `asked` for one: the protocol's
    /// own, where it has one. Pixels; 0 keeps the pictures'.
    pub fn size(&self, asked: u32) -> u32 {
        if self.image_size == 0 {
            asked
        } else {
            self.image_size
        }
    }

    /// Subjects of the protocol that none of `names` is of. Without them a mean can't stand
    /// beside a published one.
    pub fn missing<'a>(&self, names: impl Iterator<Item = &'a str> + Clone) -> Vec<&'static str> {
        let absent = |subject: &&&str| !names.clone().any(|name| name.contains(**subject));
        self.subjects.iter().filter(absent).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contract_and_the_model_name_the_same_protocols() {
        let ours: Vec<&str> = PROTOCOLS.iter().map(|protocol| protocol.name).collect();
        let listed: Vec<&str> = protocols::PROTOCOLS.iter().map(|(name, _)| *name).collect();
        assert_eq!(ours, listed);
        let error = Protocol::named("zju").expect_err("half a name");
        assert!(error.to_string().contains("zju-step30"), "{error}");
    }

    #[test]
    fn a_protocol_says_which_pictures_count() {
        let step = Protocol::named("zju-step30").expect("a protocol");
        let taken: Vec<u32> = (0..100).filter(|&frame| step.takes(frame)).collect();
        assert_eq!(taken, [0, 30, 60, 90]);
        assert_eq!(step.size(64), 512);
        let free = Protocol::named("held-out").expect("a protocol");
        assert!((0..9).all(|frame| free.takes(frame)));
        assert_eq!(free.size(64), 64);
    }

    #[test]
    fn subjects_that_are_not_there_are_named() {
        let all = Protocol::named("zju-all").expect("a protocol");
        let names = ["CoreView_377", "CoreView_394", "ada"];
        assert_eq!(all.missing(names.into_iter()), ["386", "387", "392", "393"]);
        let free = Protocol::named("held-out").expect("a protocol");
        assert!(free.missing(names.into_iter()).is_empty());
    }
}
