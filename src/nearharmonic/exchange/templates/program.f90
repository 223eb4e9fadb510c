$head
! Compile and run: gfortran -O2 -o $name $name.f90 && ./$name

module ${name}_integrator
  use, intrinsic :: iso_fortran_env, only: real_kind => $kind
  implicit none
  private
  public :: ${name}_steps, real_kind

  integer, parameter :: stages = $stages

  real(real_kind), parameter :: c_$outer(0:stages) = [real(real_kind) :: &
$outer_rows &
  ]

  real(real_kind), parameter :: c_$inner(0:stages - 1) = [real(real_kind) :: &
$inner_rows &
  ]

  ! Your system, as two subroutines: kick does p = p - h dV/dq(q), drift does q = q + h dT/dp(p).
  abstract interface
    subroutine substep(h, q, p)
      import :: real_kind
      real(real_kind), intent(in) :: h
      real(real_kind), intent(inout) :: q(:), p(:)
    end subroutine substep
  end interface

contains

  ! Takes a number of steps of length tau, from q and p to q and p.
  subroutine ${name}_steps(kick, drift, tau, steps, q, p)
    procedure(substep) :: kick, drift
    real(real_kind), intent(in) :: tau
    integer, intent(in) :: steps
    real(real_kind), intent(inout) :: q(:), p(:)
    real(real_kind) :: c
    integer :: step, i

    if (steps < 1) return
    call $outer(c_$outer(0) * tau, q, p)
    do step = 1, steps
      do i = 0, stages - 1
        call $inner(c_$inner(i) * tau, q, p)
        c = c_$outer(i + 1)
        ! The last $outer of this step and the first of the next are one.
        if (i == stages - 1 .and. step < steps) c = c + c_$outer(0)
        call $outer(c * tau, q, p)
      end do
    end do
  end subroutine ${name}_steps

end module ${name}_integrator

! Example, to be replaced: the Henon-Heiles system, V = (x^2 + y^2)/2 + x^2 y - y^3/3, T = (px^2 + py^2)/2.
module henon_heiles
  use ${name}_integrator, only: real_kind
  implicit none

contains

  subroutine kick(h, q, p)
    real(real_kind), intent(in) :: h
    real(real_kind), intent(inout) :: q(:), p(:)

    p(1) = p(1) - h * (q(1) + 2 * q(1) * q(2))
    p(2) = p(2) - h * (q(2) + q(1)**2 - q(2)**2)
  end subroutine kick

  subroutine drift(h, q, p)
    real(real_kind), intent(in) :: h
    real(real_kind), intent(inout) :: q(:), p(:)

    q = q + h * p
  end subroutine drift

end module henon_heiles

program example
  use ${name}_integrator, only: ${name}_steps, real_kind
  use henon_heiles, only: kick, drift
  implicit none
  real(real_kind) :: q(2) = [0.3_real_kind, 0.0_real_kind], p(2) = [0.0_real_kind, 0.4_real_kind]

  call ${name}_steps(kick, drift, 0.25_real_kind, 80, q, p)
  print '(a, 2es$width)', "q =", q
  print '(a, 2es$width)', "p =", p
end program example
