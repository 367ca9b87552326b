//! Lens distortion: where a point of the normalised image plane (x / z, y / z) is really seen, by the models of OpenCV
//! and ROS.

use crate::{Error, Result};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector3};

/// The departure of a lens from a pinhole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distortion {
    /// None: a pinhole, or an image that was rectified.
    None,
    /// Brown and Conrady's model with a rational radial part. OpenCV and ROS call it `plumb_bob` where all beyond `k3` are
    /// 0, and `rational_polynomial` otherwise.
    Rational {
        /// Radial coefficients k1 to k6; the last three stand in the denominator.
        k: [f64; 6],
        /// Tangential coefficients p1 and p2.
        p: [f64; 2],
        /// Coefficients s1 to s4 of a thin prism.
        s: [f64; 4],
        /// Angles, in radians, by which the sensor is tilted about x and y.
        tau: [f64; 2],
    },
    /// Kannala and Brandt's fisheye model: `equidistant` in ROS and Kalibr, `cv::fisheye` in OpenCV.
    Equidistant {
        /// Coefficients k1 to k4 of the odd powers of the angle from the axis.
        k: [f64; 4],
    },
}

/// A distortion and how far from the axis it holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lens {
    distortion: Distortion,
    /// Square of the distance from the axis, on the plane z = 1, from which on the model folds back: points out there
    /// would fall on pixels that show something else.
    limit_squared: f64,
    /// From the image on an upright sensor to that on the tilted one; none where it is upright.
    tilt: Option<Matrix3<f64>>,
}

/// Steps in which the angle from the axis is searched for the fold.
const STEPS: u32 = 4096;

impl Lens {
    /// # Errors
    /// [`Error::Distortion`] where a coefficient is not finite.
    pub(crate) fn new(distortion: Distortion) -> Result<Self> {
        let coefficients = match &distortion {
            Distortion::None => Vec::new(),
            Distortion::Rational { k, p, s, tau } => [k.as_slice(), p, s, tau].concat(),
            Distortion::Equidistant { k } => k.to_vec(),
        };
        if let Some(value) = coefficients.iter().find(|c| !c.is_finite()) {
            return Err(Error::Distortion { value: *value });
        }
        let limit = fold(&distortion);
        Ok(Self {
            distortion,
            limit_squared: limit * limit,
            tilt: tilt(&distortion),
        })
    }

    pub(crate) fn is_none(&self) -> bool {
        self.distortion == Distortion::None
    }

    /// The image of (x, y) of the plane z = 1 on that plane; none beyond the fold.
    #[inline]
    pub(crate) fn bend(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let r2 = x * x + y * y;
        // written so that NaN fails
        let holds = r2 < self.limit_squared && !self.is_folded([x, y]);
        holds.then(|| match &self.distortion {
            Distortion::None => [x, y],
            Distortion::Rational { k, p, s, .. } => {
                let radial = rational(k, r2);
                let prism = [s[0] + s[1] * r2, s[2] + s[3] * r2].map(|s| s * r2);
                let [x, y] = [
                    x * radial + 2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x) + prism[0],
                    y * radial + p[0] * (r2 + 2.0 * y * y) + 2.0 * p[1] * x * y + prism[1],
                ];
                self.tilt.map_or([x, y], |tilt| {
                    let [x, y, w] = (tilt * Vector3::new(x, y, 1.0)).into();
                    [x / w, y / w]
                })
            }
            Distortion::Equidistant { k } => {
                let r = r2.sqrt();
                // near the axis both tend to 1
                let scale = if r > 1e-8 {
                    fisheye(k, r.atan()) / r
                } else {
                    1.0
                };
                [x * scale, y * scale]
            }
        })
    }

    /// True where tangential parts and prism turn the image over, which [`fold`] does not know of.
    #[inline]
    fn is_folded(&self, [x, y]: [f64; 2]) -> bool {
        let Distortion::Rational { k, p, s, .. } = &self.distortion else {
            return false;
        };
        if *p == [0.0; 2] && *s == [0.0; 4] {
            return false;
        }
        let r2 = x * x + y * y;
        let (radial, slope) = (rational(k, r2), rational_slope(k, r2));
        let prism = [s[0] + 2.0 * s[1] * r2, s[2] + 2.0 * s[3] * r2];
        let mixed = 2.0 * (x * y * slope + p[0] * x + p[1] * y);
        let derivatives = Matrix2::new(
            radial + 2.0 * (x * x * slope + p[0] * y + 3.0 * p[1] * x + x * prism[0]),
            mixed + 2.0 * y * prism[0],
            mixed + 2.0 * x * prism[1],
            radial + 2.0 * (y * y * slope + 3.0 * p[0] * y + p[1] * x + y * prism[1]),
        );
        // written so that NaN is folded
        !(derivatives.determinant() > 0.0 && derivatives.trace() > 0.0)
    }
}

/// The tilted sensor of `distortion`: what falls on an upright one goes on along its ray, and is then turned upright.
fn tilt(distortion: &Distortion) -> Option<Matrix3<f64>> {
    let Distortion::Rational { tau, .. } = distortion else {
        return None;
    };
    let about = |axis, angle| *Rotation3::from_axis_angle(&axis, angle).matrix();
    // OpenCV turns about y and x the other way around than about z
    let turn = about(Vector3::y_axis(), -tau[1]) * about(Vector3::x_axis(), -tau[0]);
    let (distance, along) = (turn[(2, 2)], [turn[(0, 2)], turn[(1, 2)]]);
    let upright = Matrix3::new(
        distance, 0.0, -along[0], 0.0, distance, -along[1], 0.0, 0.0, 1.0,
    );
    tau.iter()
        .any(|&angle| angle != 0.0)
        .then_some(upright * turn)
}

fn rational(k: &[f64; 6], r2: f64) -> f64 {
    let polynomial = |a: f64, b: f64, c: f64| 1.0 + r2 * (a + r2 * (b + r2 * c));
    polynomial(k[0], k[1], k[2]) / polynomial(k[3], k[4], k[5])
}

/// Derivative of [`rational`] by r2.
fn rational_slope(k: &[f64; 6], r2: f64) -> f64 {
    let polynomial = |a: f64, b: f64, c: f64| 1.0 + r2 * (a + r2 * (b + r2 * c));
    let slope = |a: f64, b: f64, c: f64| a + r2 * (2.0 * b + r2 * 3.0 * c);
    let below = polynomial(k[3], k[4], k[5]);
    (slope(k[0], k[1], k[2]) - rational(k, r2) * slope(k[3], k[4], k[5])) / below
}

fn fisheye(k: &[f64; 4], angle: f64) -> f64 {
    let s = angle * angle;
    angle * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))))
}

/// Distance from the axis on the plane z = 1 at which the distorted distance stops growing; infinite where it never
/// does. Tangential parts and prisms, which differ from side to side, and tilts are left out.
fn fold(distortion: &Distortion) -> f64 {
    let distance = |angle: f64| match distortion {
        Distortion::None => angle,
        Distortion::Rational { k, .. } => {
            let r = angle.tan();
            r * rational(k, r * r)
        }
        Distortion::Equidistant { k } => fisheye(k, angle),
    };
    let step = std::f64::consts::FRAC_PI_2 / f64::from(STEPS);
    // also compared with a point nearer to the axis, for behind a pole the distance grows again, from minus infinity
    let grows = |angle: f64, from: f64| {
        let here = distance(angle);
        here >= distance(from) && distance(angle + 1e-3 * step) > here
    };
    let angle = |i: u32| f64::from(i) * step;
    let Some(first) = (0..STEPS - 1).find(|&i| !grows(angle(i), angle(i.saturating_sub(1)))) else {
        return f64::INFINITY;
    };
    let (mut low, mut high) = (angle(first.saturating_sub(1)), angle(first));
    let from = low;
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        if grows(middle, from) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low.tan()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rational_of(k: [f64; 6]) -> Distortion {
        Distortion::Rational {
            k,
            p: [0.0; 2],
            s: [0.0; 4],
            tau: [0.0; 2],
        }
    }

    fn radial(k1: f64, k2: f64, k3: f64) -> Lens {
        let k = [k1, k2, k3, 0.0, 0.0, 0.0];
        Lens::new(rational_of(k)).unwrap()
    }

    #[test]
    fn a_barrel_folds_where_its_derivative_is_zero() {
        // d/dr (r - 0.25 r^3) = 1 - 0.75 r^2
        let lens = radial(-0.25, 0.0, 0.0);
        assert!((lens.limit_squared - 4.0 / 3.0).abs() < 1e-3, "{lens:?}");
        assert!(lens.bend([1.2, 0.0]).is_none());
        assert_eq!(lens.bend([1.0, 0.0]), Some([0.75, 0.0]));
    }

    #[test]
    fn lenses_that_never_fold_see_everything() {
        assert_eq!(radial(0.1, 0.0, 0.0).limit_squared, f64::INFINITY);
        assert_eq!(
            Lens::new(Distortion::None).unwrap().bend([1e6, 3.0]),
            Some([1e6, 3.0])
        );
        assert!(
            Lens::new(Distortion::None)
                .unwrap()
                .bend([f64::NAN, 0.0])
                .is_none()
        );
    }

    #[test]
    fn a_prism_folds_on_one_side() {
        let lens = Lens::new(Distortion::Rational {
            k: [0.0; 6],
            p: [0.0; 2],
            s: [0.1, 0.0, 0.0, 0.0],
            tau: [0.0; 2],
        });
        let lens = lens.unwrap();
        // d/dx (x + 0.1 (x^2 + y^2)) = 1 + 0.2 x
        let seen = [-5.1, -4.9, 5.1].map(|x| lens.bend([x, 0.0]).is_some());
        assert_eq!(seen, [false, true, true]);
    }

    #[test]
    fn coefficients_must_be_finite() {
        let k = [0.0, f64::NAN, 0.0, 0.0];
        let error = Lens::new(Distortion::Equidistant { k }).unwrap_err();
        assert!(matches!(error, Error::Distortion { value } if value.is_nan()));
    }

    proptest! {
        #[test]
        fn no_two_angles_within_the_limit_share_a_pixel(
            k in proptest::array::uniform6(-0.4_f64..0.4), near in 0.0_f64..0.99, far in 0.0_f64..0.99,
        ) {
            let lens = Lens::new(rational_of(k)).unwrap();
            let reach = lens.limit_squared.sqrt().min(50.0);
            let [near, far] = [near.min(far), near.max(far)].map(|share| share * reach);
            prop_assume!(far - near > 1e-3);
            let seen = [near, far].map(|r| lens.bend([r, 0.0]).unwrap()[0]);
            prop_assert!(seen[0] < seen[1], "{:?} of {:?}", seen, [near, far]);
        }
    }
}
