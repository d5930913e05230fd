"""Rotations by three angles, as surveyors and drones write them.

All turn camera axes x right, y up, z backward into a world of x east, y north, z up: with all
angles zero the camera looks down, its top to the north. Omega, phi, kappa:
``world_from_cam = Rx(omega) Ry(phi) Rz(kappa)`` (Open Photogrammetry Format, "Input camera
format"). Heading (yaw), pitch, roll: ``world_from_cam = Rz(-heading) Rx(pitch) Ry(roll)``
("Registration export and camera orientations", forums.unrealengine.com).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from texproj.formats.interchange.model import Y_AND_Z_FLIPPED, Array


def rotation_of_omega_phi_kappa(angles_deg: ArrayLike) -> Array:
    """(3, 3) cam_from_world of omega, phi, kappa in degrees."""
    omega, phi, kappa = np.deg2rad(np.asarray(angles_deg, np.float64))
    return Y_AND_Z_FLIPPED @ (_about_x(omega) @ _about_y(phi) @ _about_z(kappa)).T


def omega_phi_kappa_deg(R: Array) -> tuple[float, float, float]:
    """Omega, phi, kappa of a cam_from_world, degrees; exact also where phi is 90 degrees and omega
    and kappa turn about the same axis: kappa makes up for the omega found.
    """
    world_from_cam = (Y_AND_Z_FLIPPED @ R).T
    omega = np.arctan2(-world_from_cam[1, 2], world_from_cam[2, 2])
    phi = np.arctan2(world_from_cam[0, 2], np.hypot(world_from_cam[1, 2], world_from_cam[2, 2]))
    rest = (_about_x(omega) @ _about_y(phi)).T @ world_from_cam
    kappa = np.arctan2(rest[1, 0], rest[0, 0])
    return float(np.rad2deg(omega)), float(np.rad2deg(phi)), float(np.rad2deg(kappa))


def rotation_of_heading_pitch_roll(angles_deg: ArrayLike) -> Array:
    """(3, 3) cam_from_world of heading, pitch, roll in degrees."""
    heading, pitch, roll = np.deg2rad(np.asarray(angles_deg, np.float64))
    return Y_AND_Z_FLIPPED @ (_about_z(-heading) @ _about_x(pitch) @ _about_y(roll)).T


def heading_pitch_roll_deg(R: Array) -> tuple[float, float, float]:
    """Heading, pitch, roll of a cam_from_world, degrees; exact also where pitch is 90 degrees (a
    level camera) and heading and roll turn about the same axis: roll makes up for the heading.
    """
    heading = np.arctan2(-R[1, 0], -R[1, 1])
    pitch = np.arctan2(-R[1, 2], np.hypot(R[1, 0], R[1, 1]))
    s, c = np.sin(heading), np.cos(heading)
    roll = np.arctan2(s * R[2, 1] - c * R[2, 0], c * R[0, 0] - s * R[0, 1])
    return float(np.rad2deg(heading)), float(np.rad2deg(pitch)), float(np.rad2deg(roll))


def _about_x(angle_rad: float) -> Array:
    s, c = np.sin(angle_rad), np.cos(angle_rad)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_y(angle_rad: float) -> Array:
    s, c = np.sin(angle_rad), np.cos(angle_rad)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _about_z(angle_rad: float) -> Array:
    s, c = np.sin(angle_rad), np.cos(angle_rad)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
