//! The figures as a table for people.

use super::{Figures, Near, Outline, Person, Stress};

impl Stress {
    /// Figures by person, in poses and from the sides, with the worst poses, and means.
    pub fn table(&self) -> String {
        let mut lines = vec![format!(
            "{:<22} {:>9} {:>9} {:>9} {:>9}   {:>9} {:>9} {:>9}  worst poses",
            "", "poses, dB", "overlap", "holes, %", "strays, %", "sides, dB", "overlap", "worst"
        )];
        let row = |name: &str, poses: &[Figures], sides: &[Figures]| {
            let (of_poses, of_sides) = (Means::of(poses), Means::of(sides));
            let worst = sides.iter().map(|it| it.outline.overlap);
            format!(
                "{name:<22} {:>9.2} {:>9.3} {:>9.2} {:>9.2}   {:>9.2} {:>9.3} {:>9.3}  {}",
                of_poses.psnr,
                of_poses.outline.overlap,
                100.0 * of_poses.outline.holes,
                100.0 * of_poses.outline.strays,
                of_sides.psnr,
                of_sides.outline.overlap,
                worst.fold(1.0, f64::min),
                worst_poses(poses)
            )
        };
        let near = |person: &Person, what: &str, near: &Near| -> Option<String> {
            let gestures = near.0.iter();
            let gestures = gestures.map(|(name, psnr)| format!("{name} {psnr:.2}"));
            let gestures = gestures.collect::<Vec<_>>().join(", ");
            let mean = near.mean()?;
            Some(format!(
                "{:<22} {what} {mean:.2} dB: {gestures}",
                person.name
            ))
        };
        let measured = || self.people.iter().filter(|it| !it.poses.is_empty());
        for person in measured() {
            lines.push(row(&person.name, &person.poses, &person.sides));
            lines.extend(near(person, "hands", &person.hands));
            lines.extend(near(person, "face", &person.face));
        }
        match measured().count() {
            0 => return "sheets alone: nobody's truth is known".to_owned(),
            1 => return lines.join("\n"),
            _ => {}
        }
        let all = |of: fn(&Person) -> &Vec<Figures>| -> Vec<Figures> {
            measured().flat_map(of).cloned().collect()
        };
        lines.push(row("mean", &all(|it| &it.poses), &all(|it| &it.sides)));
        lines.join("\n")
    }
}

/// Means over pictures.
struct Means {
    psnr: f64,
    outline: Outline,
}

impl Means {
    fn of(figures: &[Figures]) -> Self {
        let outlines: Vec<Outline> = figures.iter().map(|it| it.outline).collect();
        Self {
            psnr: figures.iter().map(|it| it.psnr).sum::<f64>() / figures.len().max(1) as f64,
            outline: Outline::mean(&outlines),
        }
    }
}

/// The three poses with the lowest figures.
fn worst_poses(figures: &[Figures]) -> String {
    let mut sorted: Vec<&Figures> = figures.iter().collect();
    sorted.sort_by(|a, b| a.psnr.total_cmp(&b.psnr));
    let mut names: Vec<&str> = Vec::new();
    for it in sorted {
        if !names.contains(&it.pose.as_str()) {
            names.push(&it.pose);
        }
    }
    names.truncate(3);
    names.join(", ")
}
