//! A decoder is learned from made-up people, who differ by two numbers.

use super::cells::Means;
use super::file::FileError;
use super::learn::{ExamplePerson, LearnError};
use super::parts::{BodyPlace, PARTS, Parts};
use super::{Decoder, Prior};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::smpl::{AVERAGE_REST, JOINTS};

/// A person in a coat of one colour all around, with a face before dark hair that is as long as `hair` says.
fn colour(place: BodyPlace, [coat, hair]: [f32; 2]) -> [f32; 3] {
    let before = place.around < 0.25 || place.around > 0.75;
    match place.part {
        1 if before && place.along < 1.0 => [0.8, 0.6, 0.5],
        1 if place.along > 0.6 - 0.3 * hair => [0.1, 0.1, 0.1],
        1 => [0.8, 0.6, 0.5],
        _ => [coat, 0.5, 1.0 - coat],
    }
}

/// Places all over the body.
fn places() -> impl Iterator<Item = BodyPlace> {
    (0..PARTS).flat_map(|part| {
        (0..1200).map(move |index| BodyPlace {
            part,
            along: -0.1 + 1.4 * (index / 40) as f32 / 30.0,
            around: ((index % 40) as f32 + 0.5) / 40.0,
        })
    })
}

fn person(numbers: [f32; 2], shows: impl Fn(BodyPlace) -> bool) -> ExamplePerson {
    let all = places().filter(|place| shows(*place));
    ExamplePerson {
        means: Means::of(all.map(|place| (place, colour(place, numbers), 1e-3))),
    }
}

fn learned() -> Decoder {
    let numbers = (0..12).map(|index| [(index % 4) as f32 / 3.0, (index / 4) as f32 / 2.0]);
    let people: Vec<ExamplePerson> = numbers.map(|it| person(it, |_| true)).collect();
    Decoder::learn(&people, 6).expect("enough people")
}

#[test]
fn a_back_is_that_of_people_with_such_a_front() {
    let (decoder, numbers) = (learned(), [0.8, 0.25]);
    let front = |place: BodyPlace| place.around < 0.25 || place.around > 0.75;
    let decoded = decoder.of_person(&person(numbers, front).means);
    for place in places().filter(|place| !front(*place) && (0.05..0.95).contains(&place.along)) {
        // At the back, not within a cell of the front.
        if !(0.3..0.7).contains(&place.around) {
            continue;
        }
        let (guess, truth) = (decoded.colour(place), colour(place, numbers));
        let hairline = place.part == 1 && (0.2..0.7).contains(&place.along);
        for c in 0..3 {
            let off = (guess[c] - truth[c]).abs();
            assert!(
                hairline || off < 0.1,
                "{place:?}: {guess:?}, truth {truth:?}"
            );
        }
    }
}

#[test]
fn nobody_is_the_mean_person() {
    let decoder = learned();
    let nobody = Means::of(std::iter::empty());
    let [.., blue] = decoder.of_person(&nobody).colour(BodyPlace {
        part: 0,
        along: 0.5,
        around: 0.5,
    });
    assert!((blue - 0.5).abs() < 0.01, "{blue}");
    let mut dark = person([0.5, 0.5], |_| true);
    dark.means
        .colours
        .iter_mut()
        .for_each(|it| *it = [f32::NAN; 3]);
    let colour = decoder.of_person(&dark.means).colour(BodyPlace {
        part: 0,
        along: 0.5,
        around: 0.5,
    });
    assert!(colour.iter().all(|number| number.is_finite()), "{colour:?}");
}

#[test]
fn a_decoder_needs_people() {
    let people = [person([0.0, 0.0], |_| true), person([1.0, 1.0], |_| true)];
    for rank in [0, 3] {
        assert!(matches!(
            Decoder::learn(&people, rank),
            Err(LearnError::People { people: 2, .. })
        ));
    }
    assert!(Decoder::learn(&people, 2).is_ok());
    let skeleton = Skeleton {
        names: JOINTS.map(|(name, _)| name.to_uppercase()).to_vec(),
        parents: JOINTS.map(|(_, parent)| parent).to_vec(),
        rest: AVERAGE_REST.to_vec(),
    };
    assert!(ExamplePerson::new(&skeleton, std::iter::empty()).is_none());
    assert!(Parts::of(&skeleton).is_none());
}

#[test]
fn a_file_gives_the_decoder_back_and_faults_are_named() {
    let decoder = learned();
    let bytes = decoder.to_bytes(&[("licence", "MIT")]).expect("a file");
    assert_eq!(Decoder::from_bytes(&bytes).expect("reads"), decoder);
    assert!(matches!(
        Decoder::from_bytes(b"{}"),
        Err(FileError::Format(_))
    ));
    let mut cut = bytes.clone();
    cut.truncate(bytes.len() - 1);
    assert!(matches!(
        Decoder::from_bytes(&cut),
        Err(FileError::Format(_))
    ));
    let mut wrong = bytes;
    let last = wrong.len() - 4;
    wrong[last..].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(
        Decoder::from_bytes(&wrong),
        Err(FileError::Number(_))
    ));
    let narrow = Decoder {
        mean: decoder.mean[1..].to_vec(),
        basis: decoder.basis,
    };
    assert!(narrow.to_bytes(&[]).is_err(), "a cell is missing");
}

#[test]
fn the_program_has_a_decoder() {
    let people = Prior::People;
    assert!(people.decoder().is_some_and(|it| !it.basis.is_empty()));
    assert!(Prior::None.decoder().is_none());
}
