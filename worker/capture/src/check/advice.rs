//! Advice for the next film.

use super::framing::Framing;
use super::motion::Motion;
use super::report::{Grade, Lack, Measure};

/// Sides of a body, each with its view directions: of 12 around the body, from its front towards its left.
const SIDES: [(&str, [usize; 3]); 4] = [
    ("front", [11, 0, 1]),
    ("left side", [2, 3, 4]),
    ("back", [5, 6, 7]),
    ("right side", [8, 9, 10]),
];
/// Fewest frames that show a side well.
const WELL: usize = 5;
/// Highest speed of a slow rotation, degrees per second.
const SLOW: f64 = 90.0;
/// Distance of the hands as a share of that with the arms stretched out: at `OUT` and above the arms are
/// out, at `DOWN` and below they are down.
const OUT: f64 = 0.75;
const DOWN: f64 = 0.55;
/// A part of the body may be outside of the picture in this share of the frames, and a mask may be cut off in as many.
const CUT: f64 = 0.02;

/// What to do about sides, arms and speed.
const TURN: &str = "turn once, slowly, arms out, then down";
/// What to do about parts outside of the picture.
const STEP_BACK: &str = "keep head, hands and feet in the picture";
/// What to do about blur.
const SHARPER: &str = "more light and a fixed focus, so that nothing is blurred";
/// What to do about colours that are too bright or too dark.
const LIGHT: &str = "even light, neither glaring nor dim";

/// Findings about a film, from which advice follows.
pub(super) struct Film<'a> {
    pub motion: &'a Motion,
    pub framing: &'a Framing,
    pub blur: &'a Measure,
    pub exposure: &'a Measure,
}

/// What the film lacks; empty if nothing is missing.
pub(super) fn lacks(film: &Film<'_>) -> Vec<Lack> {
    let lack = |what: String, effect: &str, instead: &str| Lack {
        what,
        effect: effect.to_owned(),
        instead: instead.to_owned(),
    };
    let mut lacks = Vec::new();
    let seen = |directions: [usize; 3]| -> usize {
        let frames = directions.iter().map(|at| film.motion.headings[*at]);
        frames.sum()
    };
    let unseen = SIDES
        .iter()
        .filter(|(_, directions)| seen(*directions) == 0);
    let unseen: Vec<&str> = unseen.map(|(side, _)| *side).collect();
    match unseen.as_slice() {
        [] => {}
        [side] => {
            let what = format!("the {side} was never seen");
            lacks.push(lack(what, "it will be guessed", TURN));
        }
        [first @ .., last] => {
            let first = first.join(", the ");
            let what = format!("the {first} and the {last} were never seen");
            lacks.push(lack(what, "they will be guessed", TURN));
        }
    }
    for (side, directions) in SIDES {
        let frames = seen(directions);
        if (1..WELL).contains(&frames) {
            let plural = if frames == 1 { "" } else { "s" };
            let what = format!("the {side} was seen in {frames} frame{plural} only");
            lacks.push(lack(what, "it will be rough", TURN));
        }
    }
    if let Some([least, most]) = film.motion.reach {
        if most < OUT {
            let hidden = "the insides of the arms and the sides of the trunk will be guessed";
            lacks.push(lack("the arms were never held out".into(), hidden, TURN));
        }
        if least > DOWN {
            let hidden = "how clothes fall there will be guessed";
            lacks.push(lack("the arms were never down".into(), hidden, TURN));
        }
    }
    if film.motion.rotation_speed > SLOW {
        let degrees = film.motion.rotation_speed;
        lacks.push(lack(
            format!("the body turns by {degrees:.0}° per second"),
            "slower turns are sharper, and seen in more frames",
            TURN,
        ));
    }
    let frames = film.framing.frames;
    for (part, outside) in film.framing.outside() {
        if outside as f64 > CUT * frames as f64 {
            let what = format!("{part} outside of the picture in {outside} of {frames} frames");
            lacks.push(lack(what, "what is outside is not learnt", STEP_BACK));
        }
    }
    for (measure, effect, instead) in [
        (film.blur, "finer detail can't be learnt", SHARPER),
        (film.exposure, "colours at either end are lost", LIGHT),
    ] {
        if measure.grade != Grade::Pass {
            let what = format!("{}: {}", measure.kind.title(), measure.shown);
            lacks.push(lack(what, effect, instead));
        }
    }
    lacks
}

/// All lacks in words, and how to film instead.
pub(super) fn advice(lacks: &[Lack]) -> Vec<String> {
    let mut advice: Vec<String> = lacks.iter().map(Lack::sentence).collect();
    if let Some(instead) = Lack::instead(lacks) {
        advice.push(format!("better: {instead}"));
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::super::report::MeasureKind;
    use super::*;

    fn motion() -> Motion {
        Motion {
            jumps: Vec::new(),
            seconds: 8.0,
            jitter: None,
            headings: [10; 12],
            reach: Some([0.3, 0.98]),
            rotation_speed: 40.0,
        }
    }

    fn measure(kind: MeasureKind, grade: Grade, shown: &str) -> Measure {
        Measure {
            kind,
            grade,
            value: None,
            shown: shown.to_owned(),
            meaning: String::new(),
            cause: None,
            frames: Vec::new(),
        }
    }

    fn found(motion: &Motion, framing: &Framing, blur: Grade) -> Vec<String> {
        advice(&lacks(&Film {
            motion,
            framing,
            blur: &measure(MeasureKind::Blur, blur, "2.40 px"),
            exposure: &measure(MeasureKind::Exposure, Grade::Pass, "fine"),
        }))
    }

    fn whole() -> Framing {
        Framing {
            frames: 100,
            feet: 2,
            ..Framing::default()
        }
    }

    #[test]
    fn what_was_not_seen_is_asked_for() {
        assert!(found(&motion(), &whole(), Grade::Pass).is_empty());
        let mut frontal = motion();
        frontal.headings = [0; 12];
        frontal.headings[0] = 40;
        frontal.headings[3] = 2;
        frontal.reach = Some([0.3, 0.5]);
        let found = found(&frontal, &whole(), Grade::Pass);
        let starts = [
            "the back and the right side were never seen: they will be guessed",
            "the left side was seen in 2 frames only",
            "the arms were never held out",
            "better: turn once, slowly, arms out, then down",
        ];
        assert_eq!(found.len(), starts.len(), "{found:?}");
        for (found, start) in found.iter().zip(starts) {
            assert!(found.starts_with(start), "{found}");
        }
    }

    #[test]
    fn hasty_turns_are_told_and_a_body_without_arms_gets_no_advice_about_them() {
        let mut hasty = motion();
        hasty.rotation_speed = 200.0;
        hasty.reach = Some([0.9, 1.0]);
        let all = found(&hasty, &whole(), Grade::Pass);
        assert!(all[0].starts_with("the arms were never down"), "{all:?}");
        assert!(all[1].contains("200° per second"), "{all:?}");
        hasty.reach = None;
        assert_eq!(found(&hasty, &whole(), Grade::Pass).len(), 2);
    }

    #[test]
    fn parts_outside_and_blur_are_told_with_what_to_do() {
        let cut = Framing {
            feet: 30,
            hands: 3,
            ..whole()
        };
        let all = found(&motion(), &cut, Grade::Warn);
        let starts = [
            "hands outside of the picture in 3 of 100 frames",
            "feet outside of the picture in 30 of 100 frames",
            "blur: 2.40 px: finer detail",
            "better: keep head, hands and feet in the picture; more light",
        ];
        assert_eq!(all.len(), starts.len(), "{all:?}");
        for (found, start) in all.iter().zip(starts) {
            assert!(found.starts_with(start), "{found}");
        }
    }
}
