//! Times of the poses of a motion. A capture has the frame numbers of a film and may leave frames out, so the
//! intervals between its poses differ.

use super::Pose;
use super::readings::interpolate;

/// Longest interval between two poses after resampling, seconds.
const PAUSE: f64 = 1.0;
/// Most resampled poses per given pose.
const MOST: usize = 8;

/// The time of each frame after the first, seconds, from the frames' `numbers` in a film with `fps` frames per second.
/// If the numbers don't ascend, the frames follow each other at the film's rate.
pub fn seconds(numbers: &[u32], fps: f64) -> Vec<f64> {
    let first = numbers.first().copied().unwrap_or_default();
    let ascending = numbers.is_sorted_by(|a, b| a < b);
    let passed = numbers.iter().enumerate().map(|(index, number)| {
        let frames = match ascending {
            true => f64::from(number - first),
            false => index as f64,
        };
        frames / fps
    });
    passed.collect()
}

/// Mean rate of poses at these `seconds`, poses per second; `None` for a single one.
pub fn mean_fps(seconds: &[f64]) -> Option<f64> {
    let passed = seconds.last()? - seconds.first()?;
    (passed > 0.0).then(|| (seconds.len() - 1) as f64 / passed)
}

/// `poses` resampled at equal intervals, and their rate per second. `numbers` are the frame numbers of the poses in a
/// film with `fps` frames per second.
///
/// Poses that are at equal intervals already stay as they are. Otherwise the interval is the greatest that keeps all
/// given poses, and between them each joint takes the shortest rotation. If that makes more than [`MOST`] poses per
/// given pose, the interval is longer. A pause of more than [`PAUSE`] is a cut, or frames that were left out; it is
/// shortened to [`PAUSE`].
pub fn even(poses: Vec<Pose>, numbers: &[u32], fps: f64) -> (Vec<Pose>, f64) {
    let gaps = gaps(numbers, fps);
    let step = gaps.iter().fold(0, |step, gap| divisor(step, *gap));
    if gaps.iter().all(|gap| *gap == step) {
        return (poses, if step > 0 { fps / f64::from(step) } else { fps });
    }
    // The time of each pose after the first, in frames of the film.
    let mut passed = 0;
    let times = [0].into_iter().chain(gaps.iter().map(|gap| {
        passed += u64::from(*gap);
        passed
    }));
    let times: Vec<f64> = times.map(|time| time as f64).collect();
    let whole = passed as f64;
    let steps = (passed / u64::from(step)).min((MOST * gaps.len()) as u64);
    let at = |number: u64| {
        let time = whole * number as f64 / steps as f64;
        let here = times.partition_point(|it| *it <= time).max(1) - 1;
        match (poses.get(here + 1), times.get(here + 1)) {
            (Some(next), Some(end)) if time > times[here] => {
                let share = (time - times[here]) / (end - times[here]);
                interpolate(&poses[here], next, share)
            }
            _ => poses[here].clone(),
        }
    };
    ((0..=steps).map(at).collect(), fps * steps as f64 / whole)
}

/// Intervals between frames with these `numbers`, in frames of the film, at most [`PAUSE`] each.
fn gaps(numbers: &[u32], fps: f64) -> Vec<u32> {
    let longest = (PAUSE * fps).round().max(1.0) as u32;
    let ascending = numbers.is_sorted_by(|a, b| a < b);
    let gap = |pair: &[u32]| match ascending {
        true => (pair[1] - pair[0]).min(longest),
        false => 1,
    };
    numbers.windows(2).map(gap).collect()
}

/// The greatest common divisor.
fn divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poses with a knee that rotates by 0.1 per frame of the film.
    fn poses(numbers: &[u32]) -> Vec<Pose> {
        let pose = |number: &u32| Pose {
            rotations: vec![[0.0; 3], [0.1 * *number as f32, 0.0, 0.0]],
            translation: [*number as f32, 0.0, 0.0],
        };
        numbers.iter().map(pose).collect()
    }

    #[test]
    fn frames_that_were_left_out_take_their_time() {
        assert_eq!(seconds(&[60, 62, 64], 10.0), [0.0, 0.2, 0.4]);
        assert_eq!(mean_fps(&seconds(&[60, 62, 64], 10.0)), Some(5.0));
        assert_eq!(seconds(&[3, 1, 2], 10.0), [0.0, 0.1, 0.2]);
        assert_eq!(mean_fps(&seconds(&[3, 1, 2], 10.0)), Some(10.0));
        assert_eq!(seconds(&[], 10.0), [0.0; 0]);
        assert_eq!(mean_fps(&seconds(&[7], 10.0)), None);
    }

    #[test]
    fn equal_times_are_left_alone() {
        for numbers in [vec![60, 62, 64], vec![9], vec![], vec![7, 3, 5]] {
            let (same, fps) = even(poses(&numbers), &numbers, 30.0);
            assert_eq!(same, poses(&numbers));
            let gap = if numbers.first() == Some(&60) {
                2.0
            } else {
                1.0
            };
            assert_eq!(fps, 30.0 / gap);
        }
    }

    #[test]
    fn poses_at_other_times_stay_and_others_lie_between() {
        let numbers = [10, 12, 18, 22];
        let (found, fps) = even(poses(&numbers), &numbers, 25.0);
        assert_eq!(fps, 12.5);
        let all = poses(&[10, 12, 14, 16, 18, 20, 22]);
        assert_eq!(found.len(), all.len());
        for (found, all) in found.iter().zip(&all) {
            assert!((found.rotations[1][0] - all.rotations[1][0]).abs() < 1e-5);
            assert!((found.translation[0] - all.translation[0]).abs() < 1e-4);
        }
        for (index, given) in [(0, 0), (1, 1), (4, 2), (6, 3)] {
            assert_eq!(found[index], poses(&numbers)[given]);
        }
    }

    #[test]
    fn a_long_pause_is_a_cut() {
        let numbers: Vec<u32> = (0..100).chain([u32::MAX]).collect();
        let (found, fps) = even(poses(&numbers), &numbers, 30.0);
        assert_eq!((found.len(), fps), (100 + 30, 30.0));
        assert_eq!(found[..100], poses(&numbers)[..100]);
        assert_eq!(found.last(), poses(&numbers).last());
    }

    #[test]
    fn few_poses_of_a_long_film_do_not_become_many() {
        let numbers = [0, 25, 49, 74];
        let (found, fps) = even(poses(&numbers), &numbers, 25.0);
        assert_eq!(found.len(), 1 + 3 * MOST);
        assert!((fps - 25.0 * 24.0 / 74.0).abs() < 1e-9);
        assert_eq!(found.last(), poses(&numbers).last());
        assert!((found[12].translation[0] - 37.0).abs() < 1e-3);
    }
}
