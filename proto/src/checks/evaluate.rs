//! Orders to measure a model.

use super::scene::MAX_SIDE;
use super::{SpecFault, SpecFaults};
use crate::protocols::{HELD_OUT, PROTOCOLS, is_protocol};
use crate::tiers;
use crate::v1::EvaluateSpec;
use std::ops::RangeInclusive;

/// Sides of measured pictures, pixels: SSIM needs room for its window.
const SIDES: RangeInclusive<u32> = 16..=MAX_SIDE;
/// Pictures of a trade-off measurement.
const TRADEOFF_VIEWS: RangeInclusive<u32> = 0..=64;
/// Renders of each.
const TRADEOFF_REPEATS: RangeInclusive<u32> = 0..=32;

/// All faults of an order to measure a model.
pub fn faults(evaluate: &EvaluateSpec) -> Vec<SpecFault> {
    let mut found = SpecFaults::default();
    let protocol = evaluate.protocol.as_str();
    if !protocol.is_empty() && !is_protocol(protocol) {
        let shown: String = protocol.chars().take(80).collect();
        let known = tiers::listed(PROTOCOLS);
        let message = format!("there is no protocol '{shown}'; protocols: {known}");
        found.add("protocol", message);
    } else if !matches!(protocol, "" | HELD_OUT) {
        let message = format!(
            "'{protocol}' compares with what further cameras saw, which the service does not store; \
             measure with a capture folder at hand, or by '{HELD_OUT}'"
        );
        found.add("protocol", message);
    }
    if let Some(tradeoff) = &evaluate.tradeoff {
        found.between("tradeoff.views", tradeoff.views, &TRADEOFF_VIEWS);
        found.between("tradeoff.repeats", tradeoff.repeats, &TRADEOFF_REPEATS);
    }
    let size = evaluate.image_size;
    found.unless(size == 0 || SIDES.contains(&size), "image_size", || {
        let (least, most) = (SIDES.start(), SIDES.end());
        format!("{size} is neither 0 nor {least} to {most} pixels")
    });
    for (i, subject) in evaluate.subjects.iter().enumerate() {
        let twice = evaluate.subjects.iter().take(i).any(|it| it == subject);
        found.unless(!twice, &format!("subjects[{i}]"), || {
            format!("{subject} is named twice")
        });
    }
    found.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::TradeoffSpec;

    fn said(change: fn(&mut EvaluateSpec)) -> Vec<String> {
        let mut spec = EvaluateSpec::default();
        change(&mut spec);
        let line = |it: SpecFault| format!("{}: {}", it.field, it.message);
        faults(&spec).into_iter().map(line).collect()
    }

    #[test]
    fn an_evaluation_is_one_that_the_service_can_do() {
        assert_eq!(said(|_| {}), [""; 0]);
        assert_eq!(said(|it| it.protocol = "held-out".into()), [""; 0]);
        type Change = fn(&mut EvaluateSpec);
        let cases: [(Change, &str); 6] = [
            (
                |it| {
                    let (views, repeats) = (65, 0);
                    it.tradeoff = Some(TradeoffSpec { views, repeats });
                },
                "tradeoff.views: 65 is not between 0 and 64",
            ),
            (
                |it| {
                    let (views, repeats) = (0, 33);
                    it.tradeoff = Some(TradeoffSpec { views, repeats });
                },
                "tradeoff.repeats: 33 is not between 0 and 32",
            ),
            (|it| it.protocol = "zju".into(), "protocol: there is no"),
            (
                |it| it.protocol = "zju-all".into(),
                "protocol: 'zju-all' compares",
            ),
            (|it| it.image_size = 8, "image_size: 8 is neither"),
            (
                |it| it.subjects = vec!["subjects/a".into(); 2],
                "subjects[1]: subjects/a is named twice",
            ),
        ];
        for (change, expected) in cases {
            let lines = said(change);
            assert_eq!(lines.len(), 1, "{lines:?}");
            assert!(lines[0].starts_with(expected), "{lines:?}");
        }
    }
}
