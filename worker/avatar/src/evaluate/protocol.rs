//! Evaluation protocols as data: the pictures that are measured, and their preparation.
//!
//! Their names are those of [`yoto_proto::protocols`]. Data sets are not part of this program; a
//! protocol states the required content of a capture made from one.

use thiserror::Error;
use yoto_proto::protocols;

/// An evaluation protocol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Protocol {
    /// Name on the command line.
    pub name: &'static str,
    /// Subjects of the data set; empty if any will do.
    pub subjects: &'static [&'static str],
    /// Index of the training camera, if the data set has several cameras. The others are
    /// measured.
    pub train_camera: Option<u32>,
    /// Held-out pictures that are measured.
    pub pictures: Pictures,
    /// Only frames whose number is a multiple of this are measured.
    pub frame_step: u32,
    /// Longest side of compared pictures, pixels; 0 leaves it to the caller.
    pub image_size: u32,
    /// Whether pixels outside the person's projected box are black in both pictures.
    pub black_outside_box: bool,
    /// Whether published figures by this protocol exist; if not, pictures are only viewed.
    pub figures: bool,
}

/// Kinds of held-out pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pictures {
    /// Poses that were trained on, from other cameras.
    Views,
    /// Trained poses from other cameras, and poses that were not trained on.
    ViewsAndPoses,
}

/// Unknown protocol.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "there is no protocol '{0}'; protocols: {list}",
    list = yoto_proto::tiers::listed(protocols::PROTOCOLS)
)]
pub struct UnknownProtocol(String);

/// The six ZJU-MoCap subjects of the paper.
const ZJU: &[&str] = &["377", "386", "387", "392", "393", "394"];

/// All protocols. Each compares pictures over black.
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
    /// If no protocol has the name; the message lists all names.
    pub fn named(name: &str) -> Result<&'static Self, UnknownProtocol> {
        let found = PROTOCOLS.iter().find(|protocol| protocol.name == name);
        found.ok_or_else(|| UnknownProtocol(name.to_owned()))
    }

    /// Whether pictures of the frame numbered `frame` are measured.
    pub fn takes(&self, frame: u32) -> bool {
        frame.is_multiple_of(self.frame_step)
    }

    /// Longest side of compared pictures, pixels: the protocol's if it has one, else `asked`. 0
    /// keeps the size of the pictures.
    pub fn size(&self, asked: u32) -> u32 {
        if self.image_size == 0 {
            asked
        } else {
            self.image_size
        }
    }

    /// Subjects of the protocol that no entry of `names` contains. Without them, a mean can't be
    /// compared with a published one.
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
