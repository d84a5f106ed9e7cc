//! Contract of designs.

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::Design;

use crate::judge::{Check, calm, judge, same_on_threads};

/// Tests a design against its contract.
///
/// - It returns the requested number of points, with the requested number of coordinates, inside the open unit cube.
/// - The same stream gives the same points, on any number of threads.
/// - Zero points or zero coordinates give an empty matrix or an error.
/// - If it can be extended, the further points are inside the cube and the same for the same stream.
/// - The mean of each coordinate is no further from one half than that of independent points would be.
pub fn design(name: &str, design: &dyn Design) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 5] = [
        ("fills the unit cube", Box::new(|| fills_the_cube(design))),
        ("repeats itself", Box::new(|| repeats_itself(design))),
        ("bears empty designs", Box::new(|| bears_empty_designs(design))),
        ("extends itself", Box::new(|| extends_itself(design))),
        ("is centred", Box::new(|| is_centred(design))),
    ];
    judge("design", name, &checks)
}

fn points(design: &dyn Design, count: usize, dimension: usize) -> Result<Matrix, String> {
    let stream = Stream::root(1).named("design");
    let points = design.points(count, dimension, &stream);
    points.map_err(|stop| format!("{count} points of {dimension} coordinates are refused: {stop}"))
}

fn fills_the_cube(design: &dyn Design) -> Result<(), String> {
    for (count, dimension) in [(1, 1), (2, 3), (3, 2), (16, 1), (40, 5)] {
        let points = points(design, count, dimension)?;
        let shape = (points.rows(), points.columns());
        if shape != (count, dimension) {
            return Err(format!("asked for {count} x {dimension}, got {} x {}", shape.0, shape.1));
        }
        if let Some(x) = points.as_slice().iter().find(|&&x| !(x > 0.0 && x < 1.0)) {
            return Err(format!("a coordinate of {count} points is {x}"));
        }
    }
    Ok(())
}

fn repeats_itself(design: &dyn Design) -> Result<(), String> {
    if points(design, 30, 3)? != points(design, 30, 3)? {
        return Err("the same stream gives other points".into());
    }
    same_on_threads(|| points(design, 30, 3))
}

fn bears_empty_designs(design: &dyn Design) -> Result<(), String> {
    for (count, dimension) in [(0, 3), (5, 0), (0, 0)] {
        let what = format!("a design of {count} points of {dimension} coordinates");
        let stream = Stream::root(1);
        if let Ok(points) = calm(&what, || design.points(count, dimension, &stream))?
            && points.as_slice() != [0.0; 0]
        {
            return Err(format!("{what} has entries"));
        }
    }
    Ok(())
}

fn extends_itself(design: &dyn Design) -> Result<(), String> {
    let stream = Stream::root(1).named("design");
    let known = points(design, 20, 2)?;
    let parameters =
        ["x", "y"].map(|name| Parameter::plain(name, Distribution::Uniform([0.0, 1.0])));
    let further = || design.extend(&parameters, &known, 7, &stream);
    // A design that reports that it cannot be extended fulfils the contract.
    let Ok(first) = further() else { return Ok(()) };
    if (first.rows(), first.columns()) != (7, 2) {
        return Err(format!(
            "asked for 7 further points, got {} x {}",
            first.rows(),
            first.columns()
        ));
    }
    if let Some(x) = first.as_slice().iter().find(|&&x| !(x > 0.0 && x < 1.0)) {
        return Err(format!("a coordinate of a further point is {x}"));
    }
    if further() != Ok(first) {
        return Err("the same stream extends it by other points".into());
    }
    Ok(())
}

fn is_centred(design: &dyn Design) -> Result<(), String> {
    const COUNT: usize = 200;
    let points = points(design, COUNT, 4)?;
    // The mean of n independent uniform numbers has the standard deviation 1 / sqrt(12 n).
    let error = 1.0 / (12.0 * COUNT as f64).sqrt();
    for j in 0..4 {
        let mean = points.column(j).iter().sum::<f64>() / COUNT as f64;
        if (mean - 0.5).abs() > 4.0 * error {
            return Err(format!("the mean of coordinate {} is {mean}", j + 1));
        }
    }
    Ok(())
}
