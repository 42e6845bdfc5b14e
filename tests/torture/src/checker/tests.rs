//! The checker finds what a broken guard would leave behind.

use super::*;
use crate::fault::Fault;

fn acknowledged(job: &str, request: &str) -> Event {
    Event::Acknowledged {
        job: job.into(),
        request: request.into(),
    }
}

fn seen(job: &str, state: &str, attempt: u64) -> Event {
    Event::Seen {
        job: job.into(),
        state: state.into(),
        attempt,
    }
}

/// A job that was lost once and then succeeded.
fn good() -> (Vec<Event>, Final) {
    let events = vec![
        acknowledged("jobs/1", "r1"),
        seen("jobs/1", "RUNNING", 1),
        seen("jobs/1", "QUEUED", 1),
        seen("jobs/1", "RUNNING", 2),
        seen("jobs/1", "SUCCEEDED", 2),
        Event::Recovered {
            fault: Fault::WorkerKilled,
            seconds: 4.0,
        },
        Event::Late {
            job: "jobs/1".into(),
            what: "EndJob with token 1".into(),
            accepted: false,
        },
        Event::Uploaded {
            capture: "captures/1".into(),
        },
    ];
    let mut end = Final::default();
    let job = FinalJob {
        state: "SUCCEEDED".into(),
        owner: "r1".into(),
        error: String::new(),
        attempts: vec![(1, "LOST".into()), (2, "SUCCEEDED".into())],
    };
    end.jobs.insert("jobs/1".into(), job);
    end.captures
        .insert("captures/1".into(), ("READY".into(), false));
    end.repeated.push(("r1".into(), "jobs/1".into()));
    (events, end)
}

fn findings(change: impl FnOnce(&mut Vec<Event>, &mut Final)) -> Findings {
    let (mut events, mut end) = good();
    change(&mut events, &mut end);
    check(&events, &end)
}

#[test]
fn a_sound_history_is_clean() {
    let found = findings(|_, _| {});
    assert!(found.is_clean(), "{:?}", found.broken());
    let counts = (found.acknowledged, found.stale_tried);
    assert_eq!((counts, found.recovery(0.99)), ((1, 1), Some(4.0)));
}

#[test]
fn a_job_that_is_gone_or_never_ends_is_lost() {
    let gone = findings(|_, end| end.jobs.clear());
    assert_eq!(gone.lost.len(), 1);
    let open = findings(|_, end| {
        for job in end.jobs.values_mut() {
            job.state = "QUEUED".into();
            job.attempts.truncate(1);
        }
    });
    assert_eq!(open.lost.len(), 1);
    let deleted = findings(|events, end| {
        let name = "jobs/1".into();
        events.push(Event::Deleted { name });
        end.jobs.clear();
        end.repeated.clear();
    });
    assert!(deleted.is_clean(), "{:?}", deleted.broken());
}

#[test]
fn a_job_fails_or_is_cancelled_only_if_someone_wants_it() {
    for (state, wanted) in [
        (
            "FAILED",
            Event::Doomed {
                job: "jobs/1".into(),
            },
        ),
        (
            "CANCELLED",
            Event::Cancelled {
                job: "jobs/1".into(),
            },
        ),
    ] {
        let end_so = |end: &mut Final| {
            for job in end.jobs.values_mut() {
                job.state = state.into();
                job.attempts.truncate(1);
            }
        };
        let unwanted = findings(|_, end| end_so(end));
        assert_eq!(unwanted.failed.len(), 1, "{state}");
        let found = findings(|events, end| {
            end_so(end);
            events.push(wanted);
        });
        assert!(found.is_clean(), "{:?}", found.broken());
    }
}

#[test]
fn a_second_completion_and_a_second_job_of_a_request_are_duplicates() {
    let twice = findings(|_, end| {
        for job in end.jobs.values_mut() {
            job.attempts[0].1 = "SUCCEEDED".into();
        }
    });
    assert_eq!(twice.duplicated.len(), 1);
    let repeated = findings(|_, end| end.repeated.push(("r1".into(), "jobs/2".into())));
    assert_eq!(repeated.duplicated.len(), 1);
    let owned = findings(|_, end| {
        let job = end.jobs["jobs/1"].clone();
        end.jobs.insert("jobs/2".into(), job);
    });
    assert_eq!(owned.duplicated.len(), 1);
}

#[test]
fn a_falling_token_and_a_left_end_are_found() {
    let fell = findings(|events, _| {
        events.insert(4, seen("jobs/1", "RUNNING", 1));
    });
    assert_eq!(fell.unordered.len(), 1);
    let left = findings(|events, _| events.push(seen("jobs/1", "FAILED", 2)));
    assert_eq!(left.unordered.len(), 1);
    let unsorted = findings(|_, end| {
        for job in end.jobs.values_mut() {
            job.attempts.swap(0, 1);
        }
    });
    assert_eq!(unsorted.unordered.len(), 1);
}

#[test]
fn an_accepted_late_write_is_found() {
    let found = findings(|events, _| {
        events.push(Event::Late {
            job: "jobs/1".into(),
            what: "Heartbeat of another worker".into(),
            accepted: true,
        });
    });
    assert_eq!((found.stale_tried, found.stale_accepted.len()), (2, 1));
}

#[test]
fn damage_is_excused_only_where_it_was_made() {
    let damaged = |_: &mut Vec<Event>, end: &mut Final| {
        end.damaged
            .push(("models/1/x".into(), "it is missing".into()));
    };
    assert_eq!(findings(damaged).unreadable.len(), 1);
    let made = findings(|events, end| {
        damaged(events, end);
        events.push(Event::Flipped {
            key: "models/1/x".into(),
            checkpoint: "models/1/checkpoints/1".into(),
        });
    });
    assert!(made.is_clean(), "{:?}", made.broken());
    let used = findings(|events, _| {
        events.push(Event::Served {
            job: "jobs/1".into(),
            damaged: "c2".into(),
            used: "c2".into(),
        });
    });
    assert_eq!(used.corrupt_loads.len(), 1);
}

#[test]
fn checkpoints_that_nothing_keeps_are_few() {
    for (spare, faults) in [(SPARE, 0), (SPARE + 1, 1)] {
        let found = findings(|_, end| {
            end.spare.insert("models/1".into(), spare);
        });
        assert_eq!(found.hoarded.len(), faults, "{spare}");
    }
}

#[test]
fn an_upload_must_end_with_a_capture_or_with_reasons() {
    for (state, reasons, faults) in [
        ("REJECTED", true, 0),
        ("REJECTED", false, 1),
        ("INGESTING", false, 1),
    ] {
        let found = findings(|_, end| {
            end.captures
                .insert("captures/1".into(), (state.into(), reasons));
        });
        assert_eq!(found.uploads.len(), faults, "{state} {reasons}");
    }
    let gone = findings(|_, end| end.captures.clear());
    assert_eq!(gone.uploads.len(), 1);
}
