/* One UTC step of the skydiver in plain C: the yardstick of `make bench`.
 *
 * The arithmetic is that of the package with its default readings: sigma points of Pu, eq:movep and bounds, RK4 of
 * the skydiver with a held posture over N steps, means and covariances, gain, bounds and slew rate. SI and radians.
 */
#include <math.h>
#include <stdbool.h>
#include <string.h>

enum { M = 4, POINTS = 2 * M + 1, SEGMENTS = 16, INERTIA = 9 * SEGMENTS, GEOMETRY = INERTIA + 9, STATE = 13 };

/* The members are those of skydiver_utc.plant.model.PlantModel that a held posture needs. */
typedef struct {
    const double *table; /* (nodes, GEOMETRY) */
    long nodes;
    double alpha_first, nodes_per_rad, mass, gravity, half_density, damping_roll, damping_pitch, damping_volume,
        hand_force, hand_arm, minimum[M], maximum[M], alpha_slew, dt;
} Plant;

typedef struct {
    double U[M], Pu[M][M], predicted;
} Utc;

static double clip(double value, double low, double high) { return fmin(fmax(value, low), high); }

static void posture(const Plant *plant, double alpha, double *restrict out)
{
    double position = (alpha - plant->alpha_first) * plant->nodes_per_rad;
    long left = (long)floor(position) - 1;
    left = left < 0 ? 0 : left > plant->nodes - 4 ? plant->nodes - 4 : left;
    double s = position - left;
    double w0 = -(s - 1) * (s - 2) * (s - 3) / 6, w1 = s * (s - 2) * (s - 3) / 2;
    double w2 = -s * (s - 1) * (s - 3) / 2, w3 = s * (s - 1) * (s - 2) / 6;
    const double *row = plant->table + left * GEOMETRY;
    for (int i = 0; i < GEOMETRY; i++)
        out[i] = w0 * row[i] + w1 * row[GEOMETRY + i] + w2 * row[2 * GEOMETRY + i] + w3 * row[3 * GEOMETRY + i];
}

/* Inverse (xx, yy, zz, xy, xz, yz) of the symmetric inertia. */
static void invert(const double *I, double *out)
{
    double a = I[0], b = I[1], c = I[2], d = I[3], e = I[4], f = I[5];
    double xx = b * c - f * f, xy = e * f - d * c, xz = d * f - b * e, scale = 1 / (a * xx + d * xy + e * xz);
    out[0] = scale * xx, out[1] = scale * (a * c - e * e), out[2] = scale * (a * b - d * d);
    out[3] = scale * xy, out[4] = scale * xz, out[5] = scale * (d * e - a * f);
}

static void product(const double *symmetric, const double *v, double *out)
{
    out[0] = symmetric[0] * v[0] + symmetric[3] * v[1] + symmetric[4] * v[2];
    out[1] = symmetric[3] * v[0] + symmetric[1] * v[1] + symmetric[5] * v[2];
    out[2] = symmetric[4] * v[0] + symmetric[5] * v[1] + symmetric[2] * v[2];
}

/* Force and moment of air and hands about the centre of mass, in the body frame. */
static void load(const Plant *plant, const double *restrict g, const double *U, const double *x, double *out)
{
    double vx = x[7], vy = x[8], vz = x[9], wx = x[10], wy = x[11], wz = x[12];
    double fx = 0, fy = 0, fz = 0, mx = 0, my = 0, mz = 0;
    for (int i = 0; i < SEGMENTS; i++) {
        double rx = g[i], ry = g[SEGMENTS + i], rz = g[2 * SEGMENTS + i];
        double ux = vx + wy * rz - wz * ry, uy = vy + wz * rx - wx * rz, uz = vz + wx * ry - wy * rx;
        double pressure = -plant->half_density * sqrt(ux * ux + uy * uy + uz * uz);
        double axx = g[3 * SEGMENTS + i], ayy = g[4 * SEGMENTS + i], azz = g[5 * SEGMENTS + i];
        double axy = g[6 * SEGMENTS + i], axz = g[7 * SEGMENTS + i], ayz = g[8 * SEGMENTS + i];
        double sx = pressure * (axx * ux + axy * uy + axz * uz);
        double sy = pressure * (axy * ux + ayy * uy + ayz * uz);
        double sz = pressure * (axz * ux + ayz * uy + azz * uz);
        fx += sx, fy += sy, fz += sz;
        mx += ry * sz - rz * sy, my += rz * sx - rx * sz, mz += rx * sy - ry * sx;
    }
    double damping = plant->half_density * sqrt(vx * vx + vy * vy + vz * vz) * plant->damping_volume;
    out[0] = fx, out[1] = fy, out[2] = fz + plant->hand_force * (U[1] + U[2]);
    out[3] = mx - plant->damping_roll * damping * wx + plant->hand_force * plant->hand_arm * (U[2] - U[1]);
    out[4] = my - plant->damping_pitch * damping * wy;
    out[5] = mz - U[0] * damping * wz;
}

/* Derivative of (position, quaternion, velocity, angular momentum); x holds the body rates, momentum H = I omega. */
static void slope(const Plant *plant, const double *g, const double *U, const double *x, const double *H, double *out)
{
    double F[6], qx = x[3], qy = x[4], qz = x[5], qw = x[6];
    double vx = x[7], vy = x[8], vz = x[9], wx = x[10], wy = x[11], wz = x[12];
    load(plant, g, U, x, F);
    double ux = 2 * (qx * qz - qy * qw), uy = 2 * (qy * qz + qx * qw), uz = 1 - 2 * (qx * qx + qy * qy);
    out[0] = (1 - 2 * (qy * qy + qz * qz)) * vx + 2 * (qx * qy - qz * qw) * vy + 2 * (qx * qz + qy * qw) * vz;
    out[1] = 2 * (qx * qy + qz * qw) * vx + (1 - 2 * (qx * qx + qz * qz)) * vy + 2 * (qy * qz - qx * qw) * vz;
    out[2] = ux * vx + uy * vy + uz * vz;
    out[3] = 0.5 * (qw * wx + qy * wz - qz * wy);
    out[4] = 0.5 * (qw * wy + qz * wx - qx * wz);
    out[5] = 0.5 * (qw * wz + qx * wy - qy * wx);
    out[6] = -0.5 * (qx * wx + qy * wy + qz * wz);
    out[7] = F[0] / plant->mass - plant->gravity * ux - (wy * vz - wz * vy);
    out[8] = F[1] / plant->mass - plant->gravity * uy - (wz * vx - wx * vz);
    out[9] = F[2] / plant->mass - plant->gravity * uz - (wx * vy - wy * vx);
    out[10] = F[3] - (wy * H[2] - wz * H[1]);
    out[11] = F[4] - (wz * H[0] - wx * H[2]);
    out[12] = F[5] - (wx * H[1] - wy * H[0]);
}

/* One classical Runge-Kutta step of the state (13), in place. */
static void rk4(const Plant *plant, const double *U, double *x)
{
    double g[GEOMETRY], inverse[6], start[STATE], probe[STATE], next[STATE], k[STATE], H[3];
    posture(plant, U[3], g);
    invert(g + INERTIA, inverse);
    memcpy(start, x, sizeof start);
    product(g + INERTIA, x + 10, start + 10);
    memcpy(next, start, sizeof next);
    memcpy(probe, x, sizeof probe);
    memcpy(H, start + 10, sizeof H);
    for (int stage = 0; stage < 4; stage++) {
        double share = stage == 0 || stage == 3 ? plant->dt / 6 : plant->dt / 3;
        double reach = stage == 2 ? plant->dt : 0.5 * plant->dt;
        product(inverse, H, probe + 10);
        slope(plant, g, U, probe, H, k);
        for (int i = 0; i < STATE; i++)
            next[i] += share * k[i];
        for (int i = 0; i < 10; i++)
            probe[i] = start[i] + reach * k[i];
        for (int i = 0; i < 3; i++)
            H[i] = start[10 + i] + reach * k[10 + i];
    }
    double size = 1 / sqrt(next[3] * next[3] + next[4] * next[4] + next[5] * next[5] + next[6] * next[6]);
    for (int i = 0; i < 10; i++)
        x[i] = i >= 3 && i < 7 ? next[i] * size : next[i];
    product(inverse, next + 10, x + 10);
}

/* Yaw rate after N steps, from a state and the control applied now, under each of the sigma points. */
void propagate(const Plant *plant, const double *state, const double *applied, const double *points, long N,
               double *yaw_rate)
{
    for (int i = 0; i < POINTS; i++) {
        const double *U = points + i * M;
        double x[STATE], control[M], alpha = applied[3];
        memcpy(x, state, sizeof x);
        for (int j = 0; j < M; j++)
            control[j] = clip(U[j], plant->minimum[j], plant->maximum[j]);
        double wanted = control[3];
        for (long step = 0; step < N; step++) {
            control[3] = alpha = clip(wanted, alpha - plant->alpha_slew, alpha + plant->alpha_slew);
            rk4(plant, control, x);
        }
        yaw_rate[i] = x[12];
    }
}

/* Eigenvalues and eigenvectors (as columns) of a symmetric matrix by cyclic Jacobi rotations; A is used up. */
static void eigen(double A[M][M], double *values, double V[M][M])
{
    for (int i = 0; i < M; i++)
        for (int j = 0; j < M; j++)
            V[i][j] = i == j;
    for (int sweep = 0; sweep < 30; sweep++) {
        double off = 0, total = 0;
        for (int i = 0; i < M; i++)
            for (int j = 0; j < M; j++) {
                total += A[i][j] * A[i][j];
                off += i == j ? 0 : A[i][j] * A[i][j];
            }
        if (off <= 1e-32 * total)
            break;
        for (int p = 0; p < M - 1; p++)
            for (int q = p + 1; q < M; q++) {
                if (A[p][q] == 0)
                    continue;
                double theta = (A[q][q] - A[p][p]) / (2 * A[p][q]);
                double t = copysign(1 / (fabs(theta) + sqrt(theta * theta + 1)), theta);
                double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < M; k++) {
                    double a = A[k][p], b = A[k][q];
                    A[k][p] = c * a - s * b, A[k][q] = s * a + c * b;
                }
                for (int k = 0; k < M; k++) {
                    double a = A[p][k], b = A[q][k];
                    A[p][k] = c * a - s * b, A[q][k] = s * a + c * b;
                    a = V[k][p], b = V[k][q];
                    V[k][p] = c * a - s * b, V[k][q] = s * a + c * b;
                }
            }
    }
    for (int i = 0; i < M; i++)
        values[i] = A[i][i];
}

/* Sigma points of the control inside the bounds; eigenvalues of Pu below the floor are lifted to it. */
static void draw(const Plant *plant, Utc *utc, double W0, double floor, double points[POINTS][M])
{
    double root[M][M], values[M], V[M][M], scale = sqrt(M / (1 - W0));
    bool repair = false;
    for (int i = 0; i < M; i++)
        for (int j = 0; j < M; j++)
            root[i][j] = 0.5 * (utc->Pu[i][j] + utc->Pu[j][i]);
    eigen(root, values, V);
    for (int k = 0; k < M; k++)
        repair |= values[k] < floor;
    for (int i = 0; i < M; i++)
        for (int j = 0; j < M; j++) {
            double entry = 0, repaired = 0;
            for (int k = 0; k < M; k++) {
                double value = fmax(values[k], floor), share = V[i][k] * V[j][k];
                entry += share * sqrt(value);
                repaired += share * value;
            }
            root[i][j] = entry;
            if (repair)
                utc->Pu[i][j] = repaired;
        }
    for (int i = 0; i < POINTS; i++)
        for (int j = 0; j < M; j++) {
            double centre = utc->U[j], low = plant->minimum[j], high = plant->maximum[j];
            double offset = i == 0 ? 0 : i <= M ? scale * root[j][i - 1] : -scale * root[j][i - 1 - M];
            double value = centre + offset;
            if ((centre == low && value < low) || (centre == high && value > high))
                value = 1.5 * centre - 0.5 * value;
            points[i][j] = clip(value, low, high);
        }
}

/* Moves the control towards the reference, the yaw rate wanted N steps ahead. */
void utc_step(const Plant *plant, Utc *utc, const double *state, double reference, const double *Qu, double P_err,
              double W0, double floor, long N)
{
    double points[POINTS][M], Y[POINTS], U[M] = {0}, Y_mean = 0, C_y = P_err, C_uy[M] = {0}, W[POINTS];
    draw(plant, utc, W0, floor, points);
    propagate(plant, state, utc->U, &points[0][0], N, Y);
    for (int i = 0; i < POINTS; i++) {
        W[i] = i == 0 ? W0 : (1 - W0) / (2 * M);
        Y_mean += W[i] * Y[i];
        for (int a = 0; a < M; a++)
            U[a] += W[i] * points[i][a];
    }
    memcpy(utc->Pu, Qu, sizeof utc->Pu);
    for (int i = 0; i < POINTS; i++) {
        double error = Y[i] - Y_mean;
        C_y += W[i] * error * error;
        for (int a = 0; a < M; a++) {
            C_uy[a] += W[i] * (points[i][a] - U[a]) * error;
            for (int b = 0; b < M; b++)
                utc->Pu[a][b] += W[i] * (points[i][a] - U[a]) * (points[i][b] - U[b]);
        }
    }
    for (int a = 0; a < M; a++) {
        for (int b = 0; b < M; b++)
            utc->Pu[a][b] -= C_uy[a] * C_uy[b] / C_y;
        U[a] = clip(U[a] + C_uy[a] / C_y * (reference - Y_mean), plant->minimum[a], plant->maximum[a]);
    }
    U[3] = clip(U[3], utc->U[3] - plant->alpha_slew, utc->U[3] + plant->alpha_slew);
    memcpy(utc->U, U, sizeof U);
    utc->predicted = Y_mean;
}
