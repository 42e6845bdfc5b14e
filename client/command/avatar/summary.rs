//! The lines about a capture that are printed by default: what was found, what is doubtful, and what the next film should
//! show. All notes are details.

use super::capture::{Captured, Checked};
use yoto_capture::check::{Grade, Lack, Measure};

/// Frames that a line names, at most.
const NAMED: usize = 4;

/// The lines about a capture.
pub(super) fn lines(captured: &Captured, checked: &Checked) -> Vec<String> {
    let mut lines = vec![format!("found: {}", found(captured))];
    let warned = checked.report.measures.iter();
    let warned = warned.filter(|it| it.grade == Grade::Warn).map(doubt);
    let doubts = captured.found.doubts.iter().cloned().chain(warned);
    lines.extend(doubts.map(|doubt| format!("doubtful: {doubt}")));
    let lacks = lacks(captured, checked);
    if let Some(instead) = Lack::instead(&lacks) {
        let what: Vec<&str> = lacks.iter().map(|lack| lack.what.as_str()).collect();
        lines.push(format!("missing: {}", what.join("; ")));
        lines.push(format!("next time: {instead}"));
    }
    lines
}

/// What the clip lacks, by the check and by the import.
pub(super) fn lacks(captured: &Captured, checked: &Checked) -> Vec<Lack> {
    let all = checked.report.lacks.iter().chain(&captured.found.lacks);
    all.cloned().collect()
}

/// Frames, their size, the person's length, and the fit of poses, in one line.
fn found(captured: &Captured) -> String {
    let [width, height] = captured.image_size;
    let with_person = captured.frames.len();
    let (of, all) = match captured.found.fit {
        Some(fit) => (format!(" of {}", fit.searched), fit.searched),
        None => (String::new(), with_person),
    };
    let mut text = format!("the person in {with_person}{of} frames");
    if all < captured.available {
        text += &format!(" (the clip has {})", captured.available);
    }
    let tall = captured.person * f64::from(width.max(height));
    text += &format!(" of {width}x{height}, {tall:.0} px long");
    if let Some(fit) = captured.found.fit {
        let (error, focal) = (fit.error_px, fit.focal_px);
        text += &format!("; poses fitted to {error:.1} px, focal length {focal:.0} px");
    }
    text
}

/// A measure that is only a warning, with its cause and frames, in one line.
fn doubt(it: &Measure) -> String {
    let why = it.cause.as_ref().unwrap_or(&it.meaning);
    let mut text = format!("{}, {}: {why}", it.kind.title(), it.shown);
    if !it.frames.is_empty() {
        let named: Vec<String> = it.frames.iter().take(NAMED).map(u32::to_string).collect();
        let more = if it.frames.len() > NAMED { ", …" } else { "" };
        text += &format!(" (frames {}{more})", named.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::check::{Checker, MeasureKind};
    use yoto_import::{Findings, PoseFit};
    use yoto_synthetic::SyntheticPerson;

    /// A capture of 24 frames out of 50, checked.
    fn checked() -> (Captured, Checked) {
        let (track, film) = SyntheticPerson::cast(1, 7)[0].capture(24, 64);
        let captured = Captured {
            notes: Vec::new(),
            found: Findings {
                fit: Some(PoseFit {
                    searched: 25,
                    error_px: 1.82,
                    focal_px: 1469.2,
                }),
                doubts: vec!["nobody was found in 1 frame".into()],
                lacks: vec![Lack {
                    what: "left hand in sight in 3 of 24 frames".into(),
                    effect: "it will be rough".into(),
                    instead: "hands open".into(),
                }],
                people: None,
            },
            available: 50,
            frames: (0..24).collect(),
            image_size: [64, 96],
            fps: 30.0,
            person: 0.5,
            has_smpl_joints: true,
            seconds: 1.0,
        };
        let mut checker = Checker::new(track).expect("a track");
        for position in checker.wanted().to_vec() {
            checker.look(position, &film[position]);
        }
        let report = checker.finish();
        let seconds = 1.0;
        (captured, Checked { report, seconds })
    }

    #[test]
    fn what_was_found_doubtful_and_missing_is_said_once_each() {
        let (captured, mut checked) = checked();
        for measure in &mut checked.report.measures {
            if measure.kind == MeasureKind::Masks {
                measure.grade = Grade::Warn;
                measure.shown = "19.2 % cut off".into();
                measure.frames = vec![158, 160, 162, 164, 166];
            } else {
                measure.grade = Grade::Pass;
            }
        }
        let lines = lines(&captured, &checked);
        assert_eq!(
            lines[0],
            "found: the person in 24 of 25 frames (the clip has 50) of 64x96, 48 px long; poses fitted to 1.8 px, \
             focal length 1469 px"
        );
        assert_eq!(lines[1], "doubtful: nobody was found in 1 frame");
        assert!(
            lines[2].starts_with("doubtful: masks, 19.2 % cut off: "),
            "{lines:?}"
        );
        assert!(
            lines[2].ends_with("(frames 158, 160, 162, 164, …)"),
            "{lines:?}"
        );
        assert!(lines[3].contains("left hand in sight"), "{lines:?}");
        assert!(lines[4].contains("hands open"), "{lines:?}");
        assert_eq!(lines.len(), 5);
    }

    #[test]
    fn a_capture_without_a_fault_is_one_line() {
        let (mut captured, mut checked) = checked();
        captured.found = Findings::default();
        checked.report.lacks.clear();
        for measure in &mut checked.report.measures {
            measure.grade = Grade::Pass;
        }
        let lines = lines(&captured, &checked);
        assert_eq!(
            lines,
            ["found: the person in 24 frames (the clip has 50) of 64x96, 48 px long"]
        );
    }
}
