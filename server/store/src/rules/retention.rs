//! Which checkpoints a model keeps, and why.
//!
//! A training saves every half a minute, more than is needed for long. The newest checkpoints are kept to
//! resume from, the best to render with, and every n-th to look back.

use super::best::{alike, best_first};
use std::collections::HashMap;
use yoto_proto::v1::Checkpoint;

/// How many checkpoints a model keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Retention {
    /// The newest ones, at least 1.
    pub newest: u32,
    /// Keeps every n-th published checkpoint; 0: keeps none for this reason.
    pub every: u32,
}

/// A checkpoint in the catalogue.
#[derive(Debug, Clone)]
pub struct Published {
    /// The entry.
    pub checkpoint: Checkpoint,
    /// Its number among the published checkpoints of its model, from 1.
    pub number: u64,
}

/// The open jobs that use checkpoints of a model, so that these must stay.
#[derive(Debug, Clone, Default)]
pub struct Pins {
    /// A job, `jobs/{id}`, for each step that is in use.
    pub steps: HashMap<u64, String>,
    /// A job of an earlier version, which does not say which checkpoint it uses: it keeps all of them.
    pub all: Option<String>,
}

/// The reasons, for people, to keep each of the `published` checkpoints (all of a model, newest first). A
/// checkpoint without reasons is to be removed.
pub fn reasons(published: &[Published], rule: Retention, pins: &Pins) -> Vec<Vec<String>> {
    let (best, highest) = best_of_each_kind(published);
    let last = newest_numbers(published, rule.newest);
    let mut reasons = Vec::with_capacity(published.len());
    for (index, it) in published.iter().enumerate() {
        let mut why = Vec::new();
        // A training that resumed from an earlier step publishes steps below the highest.
        if index < rule.newest as usize || last.contains(&it.number) {
            why.push(match rule.newest {
                1 => "newest".to_owned(),
                newest => format!("newest {newest}"),
            });
        }
        if best.contains(&it.checkpoint.step) {
            why.push("best".to_owned());
        } else if highest.contains(&it.checkpoint.step) {
            why.push("highest PSNR".to_owned());
        }
        if rule.every > 0 && it.number.is_multiple_of(u64::from(rule.every)) {
            why.push(ordinal(rule.every));
        }
        let aliases = it.checkpoint.aliases.iter();
        why.extend(aliases.map(|alias| format!("alias {alias}")));
        let job = pins.steps.get(&it.checkpoint.step).or(pins.all.as_ref());
        why.extend(job.cloned());
        reasons.push(why);
    }
    reasons
}

/// Steps of the best checkpoints, one for each set that can be compared, so that the state before another
/// person joined stays available. Also the steps with the highest PSNR: among nearly equal checkpoints the
/// newest counts as the best, so the best could get worse little by little if the highest was not kept to
/// compare with.
fn best_of_each_kind(published: &[Published]) -> (Vec<u64>, Vec<u64>) {
    let mut rest: Vec<Checkpoint> = published.iter().map(|it| it.checkpoint.clone()).collect();
    let (mut best, mut highest) = (Vec::new(), Vec::new());
    while let Some(newest) = rest.first().cloned() {
        let (kind, others): (Vec<_>, Vec<_>) = rest.into_iter().partition(|it| alike(it, &newest));
        let measured = kind.iter().filter_map(|it| Some((it.psnr?, it.step)));
        // `max_by` takes the last of equal ones, here the newest.
        let top = measured.rev().max_by(|(a, _), (b, _)| a.total_cmp(b));
        highest.extend(top.map(|(_, step)| step));
        best.extend(best_first(kind).first().map(|it| it.step));
        rest = others;
    }
    (best, highest)
}

/// The `count` highest numbers.
fn newest_numbers(published: &[Published], count: u32) -> Vec<u64> {
    let mut numbers: Vec<u64> = published.iter().map(|it| it.number).collect();
    numbers.sort_unstable_by(|a, b| b.cmp(a));
    numbers.truncate(count as usize);
    numbers
}

/// `every 10th`.
fn ordinal(number: u32) -> String {
    let ending = match (number % 10, number % 100) {
        (1, tens) if tens != 11 => "st",
        (2, tens) if tens != 12 => "nd",
        (3, tens) if tens != 13 => "rd",
        _ => "th",
    };
    match number {
        1 => "every one".to_owned(),
        _ => format!("every {number}{ending}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: Retention = Retention {
        newest: 3,
        every: 10,
    };

    fn published(number: u64, step: u64, psnr: f64, slots: &[u32]) -> Published {
        let checkpoint = Checkpoint {
            step,
            psnr: Some(psnr),
            slots: slots.to_vec(),
            ..Checkpoint::default()
        };
        Published { checkpoint, number }
    }

    /// 25 checkpoints of rising quality, except for step 60, newest first.
    fn history() -> Vec<Published> {
        let psnr = |number| {
            if number == 6 {
                40.0
            } else {
                20.0 + number as f64 / 10.0
            }
        };
        let all = (1..=25).map(|number| published(number, 10 * number, psnr(number), &[0]));
        let mut all: Vec<Published> = all.collect();
        all.reverse();
        all
    }

    fn kept(all: &[Published], rule: Retention, pins: &Pins) -> Vec<(u64, String)> {
        let reasons = reasons(all, rule, pins);
        let kept = all.iter().zip(reasons).filter(|(_, why)| !why.is_empty());
        kept.map(|(it, why)| (it.checkpoint.step, why.join(", ")))
            .collect()
    }

    #[test]
    fn the_newest_the_best_and_every_tenth_are_kept() {
        let found = kept(&history(), RULE, &Pins::default());
        let expected = [
            (250, "newest 3"),
            (240, "newest 3"),
            (230, "newest 3"),
            (200, "every 10th"),
            (100, "every 10th"),
            (60, "best"),
        ];
        assert_eq!(found, expected.map(|(step, why)| (step, why.to_owned())));
    }

    #[test]
    fn a_model_may_keep_other_ones() {
        let steps = |newest, every| -> Vec<u64> {
            let rule = Retention { newest, every };
            let found = kept(&history(), rule, &Pins::default());
            found.into_iter().map(|(step, _)| step).collect()
        };
        assert_eq!(steps(1, 0), [250, 60]);
        assert_eq!(steps(1, 1).len(), 25);
        assert_eq!(steps(100, 0).len(), 25);
    }

    #[test]
    fn what_an_open_job_uses_is_kept() {
        let mut pins = Pins::default();
        pins.steps.insert(20, "jobs/a".to_owned());
        let found = kept(&history(), RULE, &pins);
        assert_eq!(found.last(), Some(&(20, "jobs/a".to_owned())));
        pins.all = Some("jobs/b".to_owned());
        assert_eq!(kept(&history(), RULE, &pins).len(), 25);
    }

    #[test]
    fn the_best_before_a_person_joined_is_kept_as_well() {
        let mut all = history();
        for number in 26..=30 {
            all.insert(0, published(number, 10 * number, 15.0, &[0, 1]));
        }
        let found = kept(
            &all,
            Retention {
                newest: 1,
                every: 0,
            },
            &Pins::default(),
        );
        let expected = [(300, "newest, best"), (60, "best")];
        assert_eq!(found, expected.map(|(step, why)| (step, why.to_owned())));
    }

    #[test]
    fn the_last_one_is_kept_even_if_its_step_is_not_the_highest() {
        // The highest step was torn, so the training went on from an earlier one.
        let mut all = history();
        all.push(published(26, 5, 10.0, &[0]));
        let found = kept(
            &all,
            Retention {
                newest: 1,
                every: 0,
            },
            &Pins::default(),
        );
        let steps: Vec<u64> = found.iter().map(|(step, _)| *step).collect();
        assert_eq!(steps, [250, 60, 5]);
    }

    #[test]
    fn the_best_does_not_fall_little_by_little() {
        let mut all: Vec<Published> = Vec::new();
        for number in 1..=30 {
            all.insert(
                0,
                published(number, number, 30.0 - 0.04 * number as f64, &[0]),
            );
            let rule = Retention {
                newest: 1,
                every: 0,
            };
            let reasons = reasons(&all, rule, &Pins::default());
            let mut kept = reasons.iter().map(|why| !why.is_empty());
            all.retain(|_| kept.next() == Some(true));
        }
        let steps: Vec<u64> = all.iter().map(|it| it.checkpoint.step).collect();
        assert_eq!(steps, [30, 3, 1], "the newest, the best, the highest");
    }

    #[test]
    fn ordinals_are_english() {
        let found = [1, 2, 3, 4, 11, 12, 21, 113].map(ordinal);
        let expected = [
            "every one",
            "every 2nd",
            "every 3rd",
            "every 4th",
            "every 11th",
            "every 12th",
            "every 21st",
            "every 113th",
        ];
        assert_eq!(found, expected.map(str::to_owned));
    }
}
