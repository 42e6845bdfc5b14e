//! Advice for the next film.

use super::motion::Motion;

/// Sides of a body as the directions around it from which they are seen, of 12 from its front towards
/// its left.
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

/// Advice on a film with this motion; empty if nothing is missing.
pub(super) fn advice(motion: &Motion) -> Vec<String> {
    let mut advice = Vec::new();
    for (side, directions) in SIDES {
        let frames: usize = directions.iter().map(|at| motion.headings[*at]).sum();
        match frames {
            0 => advice.push(format!("the {side} was never seen: it will be guessed")),
            1..WELL => advice.push(format!(
                "the {side} was seen in {frames} frames only: it will be rough"
            )),
            _ => {}
        }
    }
    if let Some([least, most]) = motion.reach {
        if most < OUT {
            let hidden = "the insides of the arms and the sides of the trunk will be guessed";
            advice.push(format!("the arms were never held out: {hidden}"));
        }
        if least > DOWN {
            let hidden = "how clothes fall there will be guessed";
            advice.push(format!("the arms were never down: {hidden}"));
        }
    }
    if motion.rotation_speed > SLOW {
        let degrees = motion.rotation_speed;
        advice.push(format!(
            "the body turns by {degrees:.0}° per second: slower turns are sharper, and seen in more frames"
        ));
    }
    if !advice.is_empty() {
        advice.push("better: turn once, slowly, arms out, then down".to_owned());
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complete() -> Motion {
        Motion {
            jumps: Vec::new(),
            seconds: 8.0,
            jitter: None,
            headings: [10; 12],
            reach: Some([0.3, 0.98]),
            rotation_speed: 40.0,
        }
    }

    #[test]
    fn what_was_not_seen_is_asked_for() {
        assert!(advice(&complete()).is_empty());
        let mut frontal = complete();
        frontal.headings = [0; 12];
        frontal.headings[0] = 40;
        frontal.headings[3] = 2;
        frontal.reach = Some([0.3, 0.5]);
        let found = advice(&frontal);
        let starts = [
            "the left side was seen in 2 frames only",
            "the back was never seen: it will be guessed",
            "the right side was never seen",
            "the arms were never held out",
            "better: turn once, slowly, arms out, then down",
        ];
        assert_eq!(found.len(), starts.len(), "{found:?}");
        for (found, start) in found.iter().zip(starts) {
            assert!(found.starts_with(start), "{found}");
        }
        let mut hasty = complete();
        hasty.rotation_speed = 200.0;
        hasty.reach = Some([0.9, 1.0]);
        let found = advice(&hasty);
        assert!(
            found[0].starts_with("the arms were never down"),
            "{found:?}"
        );
        assert!(found[1].contains("200° per second"), "{found:?}");
        // Without arms there is no advice about them.
        hasty.reach = None;
        assert_eq!(advice(&hasty).len(), 2);
    }
}
