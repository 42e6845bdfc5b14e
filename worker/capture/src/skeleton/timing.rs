//! When the poses of a motion follow each other. A capture numbers its frames after those of a film and may leave some
//! out, so its poses need not be at equal times.

use super::Pose;
use super::readings::between;
use yoto_proto::pose_track::MAX_FRAMES;

/// Share of a step between two poses below which times are the same: numbers of frames are exact, rates are rounded.
const ROUNDING: f64 = 1e-3;

/// Seconds from the first of the frames with these `numbers`, of a film with `fps` frames per second, to each of
/// them. Frames that are not in the order of their numbers, which captures need not be, follow each other at the film's
/// speed.
pub fn seconds(numbers: &[u32], fps: f64) -> Vec<f64> {
    let first = numbers.first().copied().unwrap_or_default();
    let ascending = numbers.is_sorted_by(|a, b| a < b);
    let passed = numbers.iter().enumerate().map(|(place, number)| {
        let frames = match ascending {
            true => f64::from(number - first),
            false => place as f64,
        };
        frames / fps
    });
    passed.collect()
}

/// Frames per second at which poses at these `seconds` move as fast as they do, on average; `None` for a single one.
pub fn mean_fps(seconds: &[f64]) -> Option<f64> {
    let passed = seconds.last()? - seconds.first()?;
    (passed > 0.0).then(|| (seconds.len() - 1) as f64 / passed)
}

/// The same motion with poses at equal times, and their number per second; `None` for a single one. Equal times are
/// left alone. Between others, as far apart as the two nearest ones of `poses`, each joint turns the shortest way.
/// `seconds` has the time of each of `poses`, ascending.
pub fn even(poses: Vec<Pose>, seconds: &[f64]) -> (Vec<Pose>, Option<f64>) {
    let Some(mean) = mean_fps(seconds) else {
        return (poses, None);
    };
    let gaps = || seconds.windows(2).map(|pair| pair[1] - pair[0]);
    if gaps().all(|gap| (gap * mean - 1.0).abs() < ROUNDING) {
        return (poses, Some(mean));
    }
    let least = gaps().fold(f64::INFINITY, f64::min);
    let passed = (seconds.len() - 1) as f64 / mean;
    let steps = (passed / least).round().min((MAX_FRAMES - 1) as f64);
    let fps = steps / passed;
    let first = seconds.first().copied().unwrap_or_default();
    let at = |step: usize| {
        let time = first + step as f64 / fps;
        let before = |it: &f64| *it <= time + ROUNDING / fps;
        let here = seconds.partition_point(before).max(1) - 1;
        match poses.get(here + 1) {
            Some(next) => {
                let share = (time - seconds[here]) / (seconds[here + 1] - seconds[here]);
                if share < ROUNDING {
                    poses[here].clone()
                } else {
                    between(&poses[here], next, share)
                }
            }
            None => poses[here].clone(),
        }
    };
    ((0..=steps as usize).map(at).collect(), Some(fps))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poses whose knee turns by a tenth per frame of the film.
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
        let numbers = [60, 62, 64];
        let (same, fps) = even(poses(&numbers), &seconds(&numbers, 30.0));
        assert_eq!(same, poses(&numbers));
        assert!((fps.expect("a motion") - 15.0).abs() < 1e-9);
        let (still, fps) = even(poses(&[9]), &[0.0]);
        assert_eq!((still.len(), fps), (1, None));
    }

    #[test]
    fn poses_at_other_times_lie_between() {
        let numbers = [10, 11, 14, 16];
        let (found, fps) = even(poses(&numbers), &seconds(&numbers, 25.0));
        assert!((fps.expect("a motion") - 25.0).abs() < 1e-9);
        let all = poses(&[10, 11, 12, 13, 14, 15, 16]);
        assert_eq!(found.len(), all.len());
        for (found, all) in found.iter().zip(&all) {
            assert!((found.rotations[1][0] - all.rotations[1][0]).abs() < 1e-5);
            assert!((found.translation[0] - all.translation[0]).abs() < 1e-4);
        }
        // What the capture has stays as it is.
        assert_eq!((&found[0], &found[4]), (&all[0], &all[4]));
    }

    #[test]
    fn a_pause_of_years_costs_no_more_than_the_longest_motion() {
        let numbers = [0, 1, u32::MAX];
        let (found, fps) = even(poses(&numbers), &seconds(&numbers, 30.0));
        assert_eq!(found.len(), MAX_FRAMES);
        assert_eq!(found.last(), poses(&numbers).last());
        assert!(fps.is_some_and(|fps| fps < 30.0));
    }
}
