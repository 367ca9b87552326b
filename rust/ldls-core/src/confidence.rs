//! Confidence: how likely the label of a point is of the right class.
//!
//! Logistic functions of the winner's share of the likelihoods and of the score of its mask, fitted to the labels of
//! simulated frames of four lidars whose truth is known.

use crate::diffusion::Diffused;
use crate::memory::{collect, tabulate};
use crate::{Cancel, Params, Result};

/// Constant, and the slope of the share and of the score, for points of objects.
const OBJECT: [f64; 3] = [-2.15, 0.24, 2.33];
/// Constant and the slope of the share for points that diffusion gave to the background.
const BACKGROUND: [f64; 2] = [1.45, 0.26];
/// Share of the points that outlier removal made background that are; that of the winner says nothing of it.
const REMOVED: f32 = 0.48;
/// The same for points that are nearer to the ground than the clearance.
const CLEARED: f32 = 0.999;
/// Shares and scores beyond these say no more.
const SHARES: [f64; 2] = [0.01, 0.999];
const SCORES: [f64; 2] = [0.05, 0.95];

/// The confidence of each label, by the share of its winner in the likelihoods, the label that diffusion gave and the
/// score of the object of each label from 1.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub fn calibrated_confidence(
    shares: &[f32],
    diffused: &[u32],
    labels: &[u32],
    scores: &[f32],
    cancel: &Cancel,
) -> Result<Vec<f32>> {
    let scores: Vec<f64> = scores
        .iter()
        .map(|&score| log_odds(score, SCORES))
        .collect();
    let probability = |share: f32, diffused: u32, label: u32| {
        let share = log_odds(share, SHARES);
        let odds = match (diffused, label) {
            (0, _) => BACKGROUND[0] + BACKGROUND[1] * share,
            (_, 0) => return REMOVED,
            (_, label) => OBJECT[0] + OBJECT[1] * share + OBJECT[2] * scores[label as usize - 1],
        };
        (1.0 / (1.0 + (-odds).exp())) as f32
    };
    // most points are far from all objects
    let surest = probability(1.0, 0, 0);
    let of_point = |i: usize| match (diffused[i], shares[i]) {
        (0, 1.0) => surest,
        (diffused, share) => probability(share, diffused, labels[i]),
    };
    tabulate(shares.len(), of_point, cancel)
}

fn log_odds(probability: f32, [low, high]: [f64; 2]) -> f64 {
    let clamped = f64::from(probability).clamp(low, high);
    (clamped / (1.0 - clamped)).ln()
}

/// The confidence of points that are nearer to the ground than the clearance.
pub(crate) fn of_cleared(params: &Params) -> f32 {
    if params.calibrated { CLEARED } else { 1.0 }
}

/// The confidence of each of `labels`, which is the share of the winner where the parameters ask for no more. Labels of
/// which it is below the parameters' become background.
pub(crate) fn judge(
    labels: &mut [u32],
    diffused: &Diffused,
    scores: &[f32],
    params: &Params,
    cancel: &Cancel,
) -> Result<Vec<f32>> {
    let shares = &diffused.confidence;
    let confidence = if params.calibrated {
        calibrated_confidence(shares, &diffused.labels, labels, scores, cancel)?
    } else {
        collect(shares.iter().copied(), cancel)?
    };
    let doubtful = |(_, confidence): &(_, &f32)| f64::from(**confidence) < params.abstain;
    let doubtful = labels.iter_mut().zip(&confidence).filter(doubtful);
    doubtful.for_each(|(label, _)| *label = 0);
    Ok(confidence)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn confidence(share: f32, diffused: u32, label: u32, score: f32) -> f32 {
        calibrated_confidence(&[share], &[diffused], &[label], &[score], Cancel::never()).unwrap()
            [0]
    }

    #[test]
    fn more_share_and_more_score_are_surer() {
        assert!(confidence(0.9, 1, 1, 0.9) > confidence(0.6, 1, 1, 0.9));
        assert!(confidence(0.9, 1, 1, 0.9) > confidence(0.9, 1, 1, 0.6));
        assert!(confidence(0.9, 0, 0, 0.5) > confidence(0.6, 0, 0, 0.5));
        assert_eq!(confidence(0.9, 1, 0, 0.5), confidence(0.6, 1, 0, 0.5));
    }

    #[test]
    fn confidence_is_a_probability_whatever_comes() {
        for value in [f32::INFINITY, -1.0, 0.0, 1.0] {
            let found = confidence(value, 1, 1, value);
            assert!((0.0..=1.0).contains(&found));
        }
    }

    #[test]
    fn doubtful_labels_are_left_out() {
        let diffused = Diffused {
            labels: vec![1, 1],
            confidence: vec![0.99, 0.4],
            convergence: crate::Convergence::default(),
        };
        let params = Params {
            calibrated: false,
            abstain: 0.5,
            ..Params::paper()
        };
        let mut labels = [1, 1];
        let confidence = judge(&mut labels, &diffused, &[1.0], &params, Cancel::never()).unwrap();
        assert_eq!(confidence, [0.99, 0.4]);
        assert_eq!(labels, [1, 0]);
    }
}
